"""A head: its mesh, built in or read from a file, and the skin painted onto it."""
