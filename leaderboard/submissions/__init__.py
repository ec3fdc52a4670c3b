"""Submissions: take a file, follow it, and sign a receipt for its score.

Only the entry points (pages, API, workers, commands) import this room.
"""
