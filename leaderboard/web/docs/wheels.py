"""The wheel and the examples that the site serves from `settings.DIST_DIR`; see `manage.py build_wheel`."""

import hashlib
from pathlib import Path
from typing import Any, Final

from django.conf import settings
from django.urls import reverse

EXAMPLES: Final = "tsttc-examples.zip"


def files() -> list[Path]:
    """List every file that the site serves here."""
    return [*paths(), *Path(settings.DIST_DIR).glob(EXAMPLES)]


def paths() -> list[Path]:
    return list(Path(settings.DIST_DIR).glob("tsttc-*-py3-none-any.whl"))


def current() -> dict[str, Any] | None:
    """Describe the latest wheel, if there is one."""
    path = max(paths(), key=lambda each: each.stat().st_mtime_ns, default=None)
    if path is None:
        return None
    return {
        "name": path.name,
        "version": path.name.split("-")[1],
        "folder": settings.SITE_URL + reverse("dist"),
        "address": settings.SITE_URL + reverse("dist_file", args=[path.name]),
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "n_bytes": path.stat().st_size,
        "examples": EXAMPLES if path.with_name(EXAMPLES).exists() else "",
    }
