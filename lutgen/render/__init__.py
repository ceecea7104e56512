"""Heads traced offline: the ground truth of the viewer."""
