"""Speed against accuracy of every method and setting."""
