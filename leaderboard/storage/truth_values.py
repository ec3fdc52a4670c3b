"""Ground-truth values: in a private directory, written by maintainers' commands, read by workers only."""

import os
from collections.abc import Iterable
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
    """Write values and manifest, whole or not at all, private to the owner; mark hidden ones first.

    Values are hidden if their split is, and also if they share a sequence with hidden ones.
    """
    directory = Path(settings.GROUND_TRUTH_DIR)
    directory.mkdir(parents=True, exist_ok=True, mode=0o700)
    if is_hidden or hidden_with(truth.manifest) is not None:
        hidden_marks.put(truth.digest)
    for part, target in ((truth, values_path(truth.digest)), (truth.manifest, manifest_path(truth.digest))):
        if not target.exists():
            with files.replacing(target) as path:
                part.save(path)
    seeds.ensure()


def hidden_with(manifest: evaluator.Manifest) -> tuple[str, str] | None:
    """Return the first hidden ground truth that has a sequence of this manifest, and the natural key of one.

    It asks the private directory alone: the database does not decide what is hidden.
    """
    return common_with(manifest, hidden_marks.digests())


def common_with(manifest: evaluator.Manifest, digests: Iterable[str]) -> tuple[str, str] | None:
    """Return the first of these ground truths that has a sequence of the manifest, and the key of one."""
    keys = frozenset(manifest.natural_keys)
    for digest in digests:
        common = keys.intersection(_manifest_keys(digest))
        if common:
            return digest, min(common)
    return None


def mark_hidden(digests: Iterable[str]) -> int:
    """Mark values that were saved before there were marks. Returns how many. Raises `OSError`."""
    unmarked = [digest for digest in digests if not hidden_marks.is_marked(digest) and _is_kept(digest)]
    for digest in unmarked:
        hidden_marks.put(digest)
    return len(unmarked)


def _is_kept(digest: str) -> bool:
    return values_path(digest).exists() or manifest_path(digest).exists()


@lru_cache(maxsize=4)
def _manifest_keys(digest: str) -> tuple[str, ...]:
    # Without values and manifest nothing is left that could be hidden.
    for path, kind in (
        (manifest_path(digest), evaluator.Manifest),
        (values_path(digest), evaluator.GroundTruth),
    ):
        if path.exists():
            kept = kind.load(path)
            return (kept if isinstance(kept, evaluator.Manifest) else kept.manifest).natural_keys
    return ()


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
