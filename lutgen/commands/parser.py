"""What the command line takes: the commands by name, and a parser that knows the options of the one asked for."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from importlib import import_module

from lutgen import errors

COMMANDS = {
    "bake": "bake a LUT set into a folder",
    "plan": "the least model that a scene needs, its predicted error and cost",
    "swatch": "color and spectrum of one skin",
    "fit": "melanin, hemoglobin, ... of a measured spectrum or color, with uncertainties",
    "info": "what a LUT set holds",
    "check": "verify a LUT set: files, axes, laws, 100 nodes against adding-doubling",
    "devices": "the OpenCL devices, best first",
    "bench": "speed of the trace, and time and error of a bake by stage",
    "figures": "the results of Zhang, Human face rendering, as charts and tables",
    "chart": "speed against accuracy of every method and setting, as charts",
    "stability": "where each method errs beyond its promise, as maps and a table",
    "view": "a window with a face shaded from a LUT set, or a picture of it",
    "sheet": "a picture of every preset on a head",
    "maps": "melanin and hemoglobin maps from a painted or photographed albedo",
    "render": "a head by Monte Carlo: the truth that the viewer is compared with",
    "compare": "how far two pictures of a scene are apart, without their noise",
    "export": "a LUT set in the form that engines open",
}
"""Every command, each a module of this package, and its line of help: written here too so that none is imported."""
_EPILOG = """\
Completion: run `eval "$(register-python-argcomplete lutgen)"` in bash or zsh, or put it into the shell's start file.
Exit status: 0, 1 where the machine fails, 2 for bad input, 130 at Ctrl-C.
"""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line: InputErrors, which the command line prints."""

    def error(self, message: str):
        """Raise what the command line prints in one line."""
        raise errors.InputError(f"{self.prog}: {message}; `{self.prog} --help` lists what is allowed")

    def _check_value(self, action: argparse.Action, value: object) -> None:
        """Allowed values as everywhere in this package: the parameter's name, its value, what is allowed."""
        if action.choices is None or isinstance(action, argparse._SubParsersAction):
            super()._check_value(action, value)
        else:
            errors.one_of(action.dest, value, tuple(action.choices))


class _Version(argparse.Action):
    """Print the version and end; it is looked up only if it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_) -> None:
        from importlib.metadata import version

        sys.stdout.write(f"lutgen {version('lutgen')}\n")
        parser.exit()


def asked(words: Iterable[str]) -> list[str]:
    """The command that a command line names, alone in a list, or nothing.

    >>> asked(["--json", "bake", "check"])
    ['bake']
    """
    return [word for word in words if word in COMMANDS][:1]


def parser(known: Sequence[str]) -> Parser:
    """A parser of all commands, with the options of the `known` ones; only their modules are imported."""
    whole = Parser(
        prog="lutgen", description="Lookup tables for real-time skin shading, baked by Monte Carlo.", epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    whole.add_argument("--version", action=_Version, nargs=0, help="print the version and end")
    commands = whole.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=Parser)
    for name, line in COMMANDS.items():
        command = commands.add_parser(name, help=line, formatter_class=argparse.RawDescriptionHelpFormatter)
        if name in known:
            module = import_module(f"lutgen.commands.{name}")
            module.arguments(command)
            command.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
            command.set_defaults(run=module.run)
            command.description = module.__doc__
            command.epilog = "\n  ".join(["examples:", *module.EXAMPLES])
    return whole
