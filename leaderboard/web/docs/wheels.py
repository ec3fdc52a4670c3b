"""The wheel that the site serves: what `pip install` takes from here, with its digest.

`manage.py build_wheel` puts it into `settings.DIST_DIR`. It has the evaluator, the command `tsttc` and the
baselines, and nothing of the leaderboard.
"""

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from django.conf import settings
from django.urls import reverse


@dataclass(frozen=True)
class Wheel:
    """A wheel: its file's name, its version, and the SHA-256 of its bytes in hexadecimal digits."""

    path: Path
    version: str
    sha256: str
    n_bytes: int

    @property
    def name(self) -> str:
        """The name of the file, which pip reads the version from."""
        return self.path.name

    @property
    def address(self) -> str:
        """Where pip finds it."""
        return settings.SITE_URL + reverse("dist_file", args=[self.name])


def current() -> Wheel | None:
    """The wheel that was built last; None where there is none."""
    return max(_all(), key=lambda wheel: wheel.path.stat().st_mtime_ns, default=None)


def named(name: str) -> Wheel | None:
    """The wheel whose file has this name."""
    return next((wheel for wheel in _all() if wheel.name == name), None)


def _all() -> list[Wheel]:
    found = []
    for path in Path(settings.DIST_DIR).glob("tsttc-*-py3-none-any.whl"):
        seen = path.stat()
        found.append(_read(path, seen.st_mtime_ns, seen.st_size))
    return found


@lru_cache(maxsize=16)
def _read(path: Path, mtime_ns: int, n_bytes: int) -> Wheel:
    """The wheel at a path; read once for as long as the file stays the same."""
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return Wheel(path=path, version=path.name.split("-")[1], sha256=digest, n_bytes=n_bytes)
