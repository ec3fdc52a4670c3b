"""What the settings read from the environment, and the private folder and keys of a checkout.

Imported by `leaderboard/settings.py` alone, before Django is configured.
"""

import os
import stat
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path
from tempfile import mkstemp
from typing import Any

import environ
from django.core.exceptions import ImproperlyConfigured

env = environ.Env()

PROFILE: str = env.str("TSTTC_PROFILE", default="embedded")
if PROFILE not in {"embedded", "production"}:
    raise ImproperlyConfigured(f"TSTTC_PROFILE is {PROFILE!r}; expected 'embedded' or 'production'.")
PRODUCTION = PROFILE == "production"

# Which process this is, so that none has to be given a secret that it has no use for.
PROCESSES = ("web", "worker", "migrate", "maintainer")
PROCESS: str = env.str("TSTTC_PROCESS", default="web")
if PROCESS not in PROCESSES:
    raise ImproperlyConfigured(f"TSTTC_PROCESS is {PROCESS!r}; expected one of {', '.join(PROCESSES)}.")


def required(name: str, *, embedded: Any, by: Collection[str] = PROCESSES, elsewhere: Any = "") -> Any:
    """The variable's text; in production its absence is an error, elsewhere `embedded` stands in.

    `by` are the processes of production that need it; in the others `elsewhere` stands in.
    """
    if not PRODUCTION:
        return env.str(name, default=embedded)
    if PROCESS in by and not env.str(name, default=""):
        raise ImproperlyConfigured(
            f"{name} is not set. In production it has no default; docs/operations.md describes it."
        )
    return env.str(name, default="") or elsewhere


def make_private(folder: Path) -> None:
    """Make a folder that its owner alone can read; one that exists is closed to everybody else.

    A folder of somebody else, or one that many share (such as /tmp), stays as it is.
    """
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    found = folder.stat()
    is_shared = found.st_uid != os.geteuid() or found.st_mode & stat.S_ISVTX
    if not is_shared and stat.S_IMODE(found.st_mode) & 0o077:
        folder.chmod(0o700)


def key_of_checkout(path: Path, make: Callable[[], str]) -> str:
    """A key of this checkout's own, made once, so that what it signed survives a restart of the demo.

    In production, where only the web process is given keys, it is one that nobody else ever has.
    """
    if PRODUCTION:
        return make()
    if not path.exists():
        # Whole at once, and the first one's for all: several processes may start together.
        handle, own = mkstemp(dir=path.parent, prefix=f".{path.name}-")
        with os.fdopen(handle, "w") as file:
            file.write(make())
        with suppress(FileExistsError):
            os.link(own, path)
        Path(own).unlink()
    return path.read_text()
