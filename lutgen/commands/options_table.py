"""The page of this room: every command with its options, from the parsers. `python -m lutgen.commands.options_table`"""

from __future__ import annotations

import argparse
from pathlib import Path

from lutgen.commands.parser import COMMANDS, Parser, parser

PAGE = Path(__file__).with_name("README.md")
_INTRODUCTION = """\
# Commands

<!-- written by `python -m lutgen.commands.options_table` -->
One file a command: `arguments(parser)` adds its options, `run(options)` does it and returns a result for `--json`, the
same as text, and an exit status; `EXAMPLES` are shown under `--help`. `parser.py` lists the commands and builds their
parser; `../cli.py` loads only the one asked for, prints what it returns, and turns errors into one line and a status:
0, 1 where the machine fails, 2 for bad input, 130 at Ctrl-C. Files named `..._options.py` hold what several commands
take, `progress.py` what long work says of itself: a bar on a terminal, elsewhere a line per stage, and in a long stage
one every 30 s; nothing with `--quiet` or `--json`.

In bash and zsh, `eval "$(register-python-argcomplete lutgen)"` completes commands, options and their allowed values.
"""


def page() -> str:
    """The page as Markdown."""
    sections = [_section(name, options) for name, options in parsers().items()]
    return "\n".join([_INTRODUCTION, *sections])


def parsers() -> dict[str, Parser]:
    """Each command's parser with all its options, by name."""
    (commands,) = (action for action in parser(tuple(COMMANDS))._actions if isinstance(action.choices, dict))
    return {name: commands.choices[name] for name in COMMANDS}  # type: ignore[index]


def _section(name: str, command: Parser) -> str:
    lines = [f"## lutgen {name}", "", (command.description or "").strip(), "", "| option | |", "|---|---|"]
    for action in command._actions:
        if not isinstance(action, argparse._HelpAction):
            meaning = ((action.help or "") % vars(action)).replace("|", "\\|")
            required = "; required" if action.required and action.option_strings else ""
            lines.append(f"| `{_spelled(action)}` | {meaning}{required} |")
    examples = (command.epilog or "").splitlines()[1:]
    return "\n".join([*lines, "", "```", *(line.strip() for line in examples), "```", ""])


def _spelled(action: argparse.Action) -> str:
    """An option as it is written on the command line, with what it takes."""
    value = action.metavar or ("{" + ",".join(action.choices) + "}" if action.choices else action.dest.upper())
    if not action.option_strings:
        return str(action.metavar or action.dest).replace("|", "\\|")
    return action.option_strings[0] + ("" if action.nargs == 0 else f" {value}")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
