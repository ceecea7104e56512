# PYTHON_ARGCOMPLETE_OK
"""The command line: runs the command asked for, and is the only place that prints errors or exits.

Only `sys` is imported before `main` is in charge, so that Ctrl-C is one line from the first instant.
"""

from __future__ import annotations

import sys


def main(arguments: list[str] | None = None) -> int:
    """Run a command and return its exit status: 0, 2 for bad input, 1 where the machine fails, 130 at Ctrl-C."""
    try:
        return _run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        return _fail("interrupted; nothing was written", 130)


def _run(arguments: list[str]) -> int:
    import io
    import json
    import os

    from lutgen import errors

    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that cannot show a sign must not fail a bake
    try:
        from lutgen.commands.parser import asked, parser

        if "_ARGCOMPLETE" in os.environ:  # a shell asks how its line can go on
            import argcomplete

            argcomplete.autocomplete(parser(asked(os.environ["COMP_LINE"].split())))
        options = parser(asked(arguments)).parse_args(arguments)
        result, text, status = options.run(options)
        print(json.dumps(result) if options.json else text, flush=True)
        return status
    except errors.InputError as error:
        return _fail(str(error), 2)
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - the reader left; say nothing at exit either
        return 1
    except (errors.MachineError, MemoryError, OSError) as error:
        return _fail(str(error) or "out of memory", 1)


def _fail(message: str, status: int) -> int:
    print(f"lutgen: {' '.join(message.split())}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
