"""The interactive viewer; of lutgen it imports only NumPy modules, never its device."""
