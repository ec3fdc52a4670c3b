"""The web application: who sent what, and what it scored."""

import gc

# First of all: to import the application makes half a million objects that stay, and Python's own thresholds
# look through them again and again, for a fifth of the time that every process needs to start.
gc.set_threshold(10_000, 50, 50)

from leaderboard.celery import app as celery_app  # noqa: E402 - see above

__all__ = ("celery_app",)
