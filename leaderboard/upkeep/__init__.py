"""Upkeep: what workers do by themselves: look for work, sweep, send mails, clean, low-priority jobs."""
