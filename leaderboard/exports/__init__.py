"""Exports: a board in other formats: CSV, JSON, LaTeX, Markdown, BibTeX, badge and feed."""
