"""Backups: everything that the site must not lose, in one folder, and back from there.

The commands `backup` and `restore` import this room; it reads boards and exports to compare them.
"""
