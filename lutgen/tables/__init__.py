"""Lookup tables: recipe, axes and wavelengths; from paths to a LUT set; how a set is stored, checked and shown."""
