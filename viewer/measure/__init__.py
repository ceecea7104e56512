"""How right and how fast the viewer is."""
