"""Spectra and tables as CSV, the source in each header line, and the scripts that make them."""
