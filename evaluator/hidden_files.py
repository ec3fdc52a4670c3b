"""Files that systems put next to others, such as `._0007.pkl`, `.DS_Store` and `__MACOSX/` of macOS."""

from __future__ import annotations

from pathlib import PurePath
from typing import Final

MACOS_FOLDER: Final = "__MACOSX"


def is_hidden(path: PurePath) -> bool:
    """Say whether a part of a relative path begins with a dot, or is the folder of macOS in archives."""
    return any(part.startswith(".") or part == MACOS_FOLDER for part in path.parts)
