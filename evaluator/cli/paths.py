"""The configuration file of the command."""

from __future__ import annotations

import json
from pathlib import Path

import click

APPLICATION = "tsttc"


def settings_file() -> Path:
    return Path(click.get_app_dir(APPLICATION)) / "settings.json"


def server_of_login() -> str | None:
    """Return the address of the last `tsttc login`, None if unknown."""
    try:
        settings = json.loads(settings_file().read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RuntimeError):  # no file, no JSON, no home directory
        return None
    server = settings.get("server") if isinstance(settings, dict) else None
    return server if isinstance(server, str) else None


def keep_server_of_login(server: str | None) -> None:
    path = settings_file()
    if server is None:
        path.unlink(missing_ok=True)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"server": server}, indent=2) + "\n", encoding="utf-8")
