"""The configuration file of the command."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import click

APPLICATION = "tsttc"


def settings_file() -> Path:
    """The file of settings: of the user's configuration, as each system has it."""
    return Path(click.get_app_dir(APPLICATION)) / "settings.json"


def command_line(words: Sequence[str], *, platform: str = sys.platform) -> str:
    """These words as one would type them in the shell of this system.

    >>> command_line(["tsttc", "check", "a b.json"], platform="linux")
    "tsttc check 'a b.json'"
    >>> print(command_line(["tsttc", "check", r"C:\\my files\\a.json"], platform="win32"))
    tsttc check "C:\\my files\\a.json"
    """
    return subprocess.list2cmdline(words) if platform == "win32" else shlex.join(words)


def server_of_login() -> str | None:
    """The address that `tsttc login` was last given; None where there was none, or it cannot be read."""
    try:
        found = json.loads(settings_file().read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RuntimeError):  # no file, no JSON, no home directory
        return None
    server = found.get("server") if isinstance(found, dict) else None
    return server if isinstance(server, str) else None


def keep_server_of_login(server: str | None) -> None:
    """Keep the address, or forget it. Raises `OSError`."""
    path = settings_file()
    if server is None:
        path.unlink(missing_ok=True)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"server": server}, indent=2) + "\n", encoding="utf-8")
