"""Exports: a board in other formats: CSV, JSON, LaTeX, Markdown, BibTeX, badge and feed.

Pages, API and commands import this room; it reads boards.
"""
