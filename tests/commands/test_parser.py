"""The parsers: nothing is imported that was not asked for, every option says what it takes, every example parses."""

import argparse
import ast
import os
import re
import shlex
import subprocess
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import pytest

import lutgen.commands
from lutgen import cli, errors, render
from lutgen.commands import options_table
from lutgen.commands.parser import COMMANDS, parser

ROOM = Path(lutgen.commands.__file__).parent
PARSERS = options_table.parsers()
NUMBERS_IN_WORDS = {"time", "size", "balance", "exposure", "eumelanin"}
"""Options that take numbers as text."""


def actions():
    """Every option of every command, --help left out."""
    for name, command in PARSERS.items():
        for action in command._actions:
            if not isinstance(action, argparse._HelpAction):
                yield pytest.param(action, id=f"{name} {action.dest}")


def in_a_new_process(code: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess:
    """Python code in a fresh interpreter."""
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, env=os.environ | environment
    )


def test_every_module_with_a_run_is_a_command():
    defines = {path.stem for path in ROOM.glob("*.py") if any(
        isinstance(node, ast.FunctionDef) and node.name == "run" for node in ast.parse(path.read_text()).body
    )}  # fmt: skip
    assert defines == set(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_line_of_help_is_the_module_s_own(name):
    first = (import_module(f"lutgen.commands.{name}").__doc__ or "").splitlines()[0]
    assert first == f"{COMMANDS[name][0].upper()}{COMMANDS[name][1:]}."


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["info", "/absent"], ["swatch", "--preset", "light"]])
def test_no_other_command_is_imported(arguments):
    code = (
        "import sys\nfrom lutgen.cli import main\n"
        "try: main(sys.argv[1:])\nexcept SystemExit: pass\n"
        "commands = [name for name in sys.modules if name.startswith('lutgen.commands.')]\n"
        "print(*commands, *{'numpy', 'argcomplete'} & {*sys.modules})"
    )
    imported = set(in_a_new_process(code, *arguments).stdout.splitlines()[-1].split())
    commands = {name.removeprefix("lutgen.commands.") for name in imported} & set(COMMANDS)
    assert commands == set(arguments) & set(COMMANDS)
    assert "argcomplete" not in imported
    assert ("numpy" in imported) == bool(commands)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_imports_nothing_heavy(name):
    code = (
        "import sys\nfrom lutgen.cli import main\n"
        "try: main([sys.argv[1], '--help'])\nexcept SystemExit: pass\n"
        "print('heavy:', *{'pyopencl', 'moderngl', 'glfw', 'matplotlib', 'scipy', 'PIL', 'rich'} & {*sys.modules})"
    )
    assert in_a_new_process(code, name).stdout.splitlines()[-1] == "heavy:"


@pytest.mark.parametrize("action", list(actions()))
def test_an_option_says_what_it_takes(action):
    assert action.help
    meaning = action.help % vars(action)
    if action.nargs != 0 and not action.required:
        assert "default" in meaning
    if action.type in (int, float) or (action.dest in NUMBERS_IN_WORDS and action.nargs != 0):
        assert re.search(r"-?\d[\d.e+-]* to \d", meaning)
    if isinstance(action.default, (int, float)) and not isinstance(action.default, bool):
        assert f"default: {action.default}" in meaning


def test_a_value_is_checked_where_it_is_read():
    """Whatever has choices says so as everything else does: name, value, allowed."""
    for name, command in PARSERS.items():
        for action in command._actions:
            if action.choices and action.option_strings:
                message = f"{action.dest} = '§': allowed is {', '.join(action.choices)}"
                with pytest.raises(errors.InputError, match=re.escape(message)):
                    parser([name]).parse_args([name, action.option_strings[0], "§"])


@pytest.mark.parametrize(
    "example", [example for name in COMMANDS for example in import_module(f"lutgen.commands.{name}").EXAMPLES]
)
def test_an_example_parses(example):
    program, *arguments = shlex.split(example)
    assert program == "lutgen"
    assert parser(arguments[:1]).parse_args(arguments).command == arguments[0]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_shows_an_example_under_its_help(name, capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main([name, "--help"])
    text = capsys.readouterr().out
    assert ended.value.code == 0
    assert "\nexamples:\n  lutgen " + name in text
    assert (import_module(f"lutgen.commands.{name}").__doc__ or "-").splitlines()[0] in text


def test_names_of_walks_are_those_of_their_functions():
    from lutgen.render import flat_walk

    assert tuple(flat_walk.WALKS) == render.WALKS


def test_the_page_of_options_is_what_the_parsers_give():
    assert options_table.PAGE.read_text(encoding="utf-8") == options_table.page(), (
        "run python -m lutgen.commands.options_table"
    )


def test_version_by_command_and_by_module():
    for command in (["-m", "lutgen"], ["-m", "lutgen.cli"]):
        done = subprocess.run([sys.executable, *command, "--version"], capture_output=True, text=True)
        assert (done.returncode, done.stdout, done.stderr) == (0, f"lutgen {version('lutgen')}\n", "")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("lutgen ba", {"bake"}),
        ("lutgen bake --qu", {"--quality", "--quiet"}),
        ("lutgen bake --quality ", {"draft", "standard", "reference"}),
        ("lutgen render --walk f", {"flat", "flat-full"}),
    ],
)
def test_a_shell_can_complete(tmp_path, line, words):
    answer = tmp_path / "answer"
    done = in_a_new_process(
        "from lutgen.cli import main; main()", _ARGCOMPLETE="1", COMP_LINE=line, COMP_POINT=str(len(line)),
        COMP_TYPE="9", _ARGCOMPLETE_IFS="\n", _ARGCOMPLETE_STDOUT_FILENAME=str(answer),
    )  # fmt: skip
    assert done.returncode == 0
    assert {word.strip() for word in answer.read_text().splitlines()} == words


@pytest.mark.parametrize(
    ("module", "swallowed"),
    [("lutgen.errors", True), ("argparse", True), ("lutgen.commands.bake", True), ("numpy", True),
     ("lutgen.tables.bake", False)],
)  # fmt: skip
def test_an_interrupt_during_an_import_is_one_line_status_130(module, swallowed, tmp_path):
    """Even where the module swallows it, as some do; the last one is imported by the running command."""
    code = (
        "import os, signal, sys\n"
        "class Interrupted:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        if name == {module!r}:\n"
        "            try: os.kill(os.getpid(), signal.SIGINT)\n"
        f"            except KeyboardInterrupt:\n                if not {swallowed}: raise\n"
        "sys.meta_path.insert(0, Interrupted())\n"
        "from lutgen.cli import main\n"
        "sys.exit(main())"
    )
    done = in_a_new_process(code, "bake", "--quality", "draft", "--out", str(tmp_path / "set"), "--quiet")
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "lutgen: interrupted; nothing was written\n"
    assert not list(tmp_path.iterdir())


def test_little_is_imported_before_an_interrupt_is_one_line():
    code = "import sys; before = {*sys.modules}; import lutgen.cli; print(*({*sys.modules} - before))"
    imported = set(in_a_new_process(code).stdout.split())
    assert "lutgen.cli" in imported
    assert not imported & {"argparse", "json", "numpy", "pathlib", "typing"}
