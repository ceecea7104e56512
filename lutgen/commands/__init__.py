"""One file a command: `arguments(parser)` adds its options, `run(options)` does it, `EXAMPLES` shows it.

The first line of its docstring is its line in `lutgen --help`, the whole docstring the text of its own `--help`.
"""

Outcome = tuple[dict, str, int]
"""What a command returns: a JSON-ready result, the same as text, and an exit status."""
