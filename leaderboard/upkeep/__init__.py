"""Upkeep: the periodic tasks of workers: look for work, sweep, send mails, clean, low-priority jobs."""
