"""Charts and tables of what the package computes: the document's results, speed against accuracy, stability."""
