"""Compare: two to five methods side by side."""
