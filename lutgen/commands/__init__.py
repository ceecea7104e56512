"""What each command does: options in; a JSON-ready result, the same as text, and an exit status out."""

Outcome = tuple[dict, str, int]
