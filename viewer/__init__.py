"""The interactive viewer; it may import only the NumPy modules of lutgen, never its device or solvers."""
