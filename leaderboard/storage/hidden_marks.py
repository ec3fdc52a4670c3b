"""Marks of hidden ground truth: a file next to the values says that they were imported as hidden ones.

Who can write into the database could call a split open. The private directory tells workers otherwise, and
only workers and the maintainers' commands can ask it.
"""

from pathlib import Path

from django.conf import settings


def put(digest: str) -> None:
    """Mark the values of this digest as hidden, for good."""
    _path(digest).touch(mode=0o600)


def is_marked(digest: str) -> bool:
    """Whether the values of this digest were imported as hidden ones, whatever the database says today."""
    return _path(digest).exists()


def _path(digest: str) -> Path:
    return Path(settings.GROUND_TRUTH_DIR) / f"{digest.removeprefix('sha256:')}.hidden"
