"""Former manifests, kept by workers in the form that the reading process takes."""

import errno
import tempfile
from functools import lru_cache
from pathlib import Path

from django.conf import settings

from evaluator import Manifest, Rejected, read_manifest
from leaderboard.storage import files


def path(digest: str) -> Path:
    """Return a file for `Manifest.load`. Raises `OSError` without the whole manifest or room for it."""
    kept = Path(settings.BAGS_DIR or Path(settings.GROUND_TRUTH_DIR) / "bags") / "manifests"
    target = kept / f"{digest.removeprefix('sha256:')}.npz"
    if not target.exists():
        manifest = _stored(digest)
        with files.replacing(target) as path_there:
            manifest.save(path_there)
    return target


@lru_cache(maxsize=1)
def load(digest: str) -> Manifest:
    """Load the manifest of this digest. Raises `OSError` as `path` does."""
    return _stored(digest)


def _stored(digest: str) -> Manifest:
    with tempfile.NamedTemporaryFile(suffix=".csv") as local:
        with files.answering(), files.open_named(files.manifest_name(digest)) as kept:
            local.write(kept.read())
        local.flush()
        try:
            manifest = read_manifest(local.name)
        except Rejected as fault:
            # Whoever sent a file is never to blame for it.
            reason = f"the manifest {digest} in the file store cannot be read: {fault}"
            raise files.StoreUnavailable(errno.EIO, reason) from fault
    if manifest.digest != digest:
        reason = f"the manifest {digest} in the file store has another content: {manifest.digest}"
        raise files.StoreUnavailable(errno.EIO, reason)
    return manifest
