"""Backups: everything that the site must not lose, in one folder, and back from there."""
