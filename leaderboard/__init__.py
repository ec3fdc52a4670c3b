"""The web application: who sent what, and what it scored."""

from leaderboard.celery import app as celery_app

__all__ = ("celery_app",)
