"""Editions: import and correct ground truth, preview, publish, roll back, and the history of it all.

Only the entry points (pages, API, workers, commands) import this room.
"""
