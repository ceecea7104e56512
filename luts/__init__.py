"""The default LUT set (default/) and its recipe (bake.toml)."""
