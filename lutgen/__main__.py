# PYTHON_ARGCOMPLETE_OK
"""`python -m lutgen`: the same as `lutgen`."""

from __future__ import annotations

import sys

from lutgen.cli import main

if __name__ == "__main__":
    sys.exit(main())
