# PYTHON_ARGCOMPLETE_OK
"""The command line: runs the command asked for, and is the only place that prints errors or exits.

Ctrl-C is one line and status 130 from the first instant: next to nothing is imported before `main` is in charge.
"""

from __future__ import annotations

import os
import signal
import sys

INTERRUPTED = "lutgen: interrupted; nothing was written"


def main(arguments: list[str] | None = None) -> int:
    """Run a command and return its exit status: 0, 2 for bad input, 1 where the machine fails, 130 at Ctrl-C."""
    try:
        if arguments is None and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, _leave)
        return _run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        print(INTERRUPTED, file=sys.stderr)
        return 130


def _leave(number, frame) -> None:
    """End at once, which is right while modules are imported: some swallow an exception or make another of it."""
    os.write(2, f"{INTERRUPTED}\n".encode())
    os._exit(130)


def _run(arguments: list[str]) -> int:
    import io
    import json

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
        if signal.getsignal(signal.SIGINT) is _leave:
            signal.signal(signal.SIGINT, signal.default_int_handler)  # a command cleans up behind itself
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
