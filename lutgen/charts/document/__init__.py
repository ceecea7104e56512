"""The source document's results, and what they are compared with."""
