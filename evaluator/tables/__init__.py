"""Boards as text: LaTeX, Markdown, CSV, and sentences about differences."""
