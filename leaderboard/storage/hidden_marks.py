"""Marks of hidden ground truth: files next to the values, out of reach of a writer of the database."""

from pathlib import Path

from django.conf import settings


def put(digest: str) -> None:
    """Mark the values of this digest as hidden, for good."""
    path(digest).touch(mode=0o600)


def is_marked(digest: str) -> bool:
    """Tell whether the values of this digest were imported as hidden."""
    return path(digest).exists()


def digests() -> tuple[str, ...]:
    """Return the digests of all values that were imported as hidden, in order."""
    marks = Path(settings.GROUND_TRUTH_DIR).glob("*.hidden")
    return tuple(sorted(f"sha256:{mark.stem}" for mark in marks))


def path(digest: str) -> Path:
    """Return the path of the mark, next to the values."""
    return Path(settings.GROUND_TRUTH_DIR) / f"{digest.removeprefix('sha256:')}.hidden"
