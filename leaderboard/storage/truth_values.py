"""Ground-truth values: in a private directory, written by maintainers' commands, read by workers only."""

import os
from functools import lru_cache
from pathlib import Path

from django.conf import settings

import evaluator
from leaderboard.storage import files, hidden_marks, seeds


def values_path(digest: str) -> Path:
    return Path(settings.GROUND_TRUTH_DIR) / f"{digest.removeprefix('sha256:')}.npz"


def manifest_path(digest: str) -> Path:
    """Return the path of the manifest, without the values."""
    return Path(settings.GROUND_TRUTH_DIR) / f"{digest.removeprefix('sha256:')}.manifest.npz"


def save(truth: evaluator.GroundTruth, *, is_hidden: bool) -> None:
    """Write values and manifest, whole or not at all, private to the owner; mark hidden ones first."""
    directory = Path(settings.GROUND_TRUTH_DIR)
    directory.mkdir(parents=True, exist_ok=True, mode=0o700)
    if is_hidden:
        hidden_marks.put(truth.digest)
    for part, target in ((truth, values_path(truth.digest)), (truth.manifest, manifest_path(truth.digest))):
        if not target.exists():
            with files.replacing(target) as path:
                part.save(path)
    seeds.ensure()


def readable_digests() -> frozenset[str]:
    """Return the digests whose values this process can read."""
    try:
        paths = list(Path(settings.GROUND_TRUTH_DIR).iterdir())
    except OSError:
        return frozenset()
    values = (path for path in paths if path.suffix == ".npz" and not path.stem.endswith(".manifest"))
    return frozenset(f"sha256:{path.stem}" for path in values if os.access(path, os.R_OK))


@lru_cache(maxsize=2)
def load(digest: str) -> evaluator.GroundTruth:
    """Load the values, for a worker. Raises `OSError` without access."""
    return evaluator.GroundTruth.load(values_path(digest))
