"""Progress without a terminal: a line per stage, one every 30 s in a long stage, none with --quiet or --json."""

from argparse import Namespace
from dataclasses import dataclass

import pytest

from lutgen import cli
from lutgen.commands import options_table, progress

LONG = ("bake", "plan", "bench", "figures", "chart", "stability", "sheet", "maps", "render", "export")


@dataclass
class Tally:
    photons: int
    of: int
    events: int


def tell(seconds, monkeypatch, **options):
    """A stage that begins at the first of these times, and tells of itself at the others."""
    clock = iter([0.0, *seconds])
    monkeypatch.setattr(progress.time, "perf_counter", lambda: next(clock))
    with progress.Progress(Namespace(**{"quiet": False, "json": False} | options)) as told:
        told("trace", None)
        for i, second in enumerate(seconds[1:], 1):
            told("trace", Tally(photons=i, of=len(seconds), events=int(3e6 * (second - seconds[0]))))


def test_a_stage_is_a_line_and_every_30_s_another(capsys, monkeypatch):
    tell([1.0, 2.0, 30.5, 31.5, 40.0, 61.6], monkeypatch)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == [
        "    1.0 s  trace",
        "   31.5 s  trace: 50%, 3 M events/s, 30 s left",
        "   61.6 s  trace: 83%, 3 M events/s, 12 s left",
    ]


@pytest.mark.parametrize("options", [{"quiet": True}, {"json": True}])
def test_quiet_and_json_say_nothing(capsys, monkeypatch, options):
    tell([1.0, 40.0], monkeypatch, **options)
    assert capsys.readouterr() == ("", "")


def test_every_long_command_can_be_quiet():
    parsers = options_table.parsers()
    assert {name for name, command in parsers.items() if "--quiet" in command.format_help()} == set(LONG)


def test_a_bake_tells_its_stages_on_stderr(capsys, tmp_path):
    arguments = ["bake", "--quality", "draft", "--photons", "2048", "--out", str(tmp_path / "set")]
    assert cli.main(arguments) == 0
    told = capsys.readouterr()
    assert [line.split(" s  ")[1] for line in told.err.splitlines()] == [
        "trace", "exact totals", "expand", "measure", "write",
    ]  # fmt: skip
