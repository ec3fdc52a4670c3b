"""Submissions: take a file, follow it, and sign a receipt for its score."""
