"""The wheel that the site serves: what `pip install` takes from here, with its digest.

`manage.py build_wheel` puts it into `settings.DIST_DIR`. It has the evaluator, the command `tsttc` and the
baselines, and nothing of the leaderboard.
"""

import hashlib
from pathlib import Path
from typing import Any

from django.conf import settings
from django.urls import reverse


def paths() -> list[Path]:
    """Every wheel that was built."""
    return list(Path(settings.DIST_DIR).glob("tsttc-*-py3-none-any.whl"))


def current() -> dict[str, Any] | None:
    """Return what pages show of the wheel that was built last; None where there is none."""
    path = max(paths(), key=lambda each: each.stat().st_mtime_ns, default=None)
    if path is None:
        return None
    return {
        "name": path.name,
        "version": path.name.split("-")[1],
        "address": settings.SITE_URL + reverse("dist_file", args=[path.name]),
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "n_bytes": path.stat().st_size,
    }
