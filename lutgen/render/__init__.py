"""Heads traced offline: the ground truth of the viewer."""

WALKS = ("flat", "flat-full", "mesh")
"""How light walks in the skin, by name: flat_walk.WALKS has the functions."""
