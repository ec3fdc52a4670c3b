"""Archives of a leaderboard: folders of its public results, which outlive the server.

A list in the folder has the digest of every other file, so damage is found without the server.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from evaluator.problems import Problem, Rejected
from evaluator.receipts import NotVerified, read_keys, verify

LIST: Final = "archive.json"
KEYS: Final = "receipt-keys.json"
RECEIPTS: Final = "receipts"
FORMAT: Final = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Archive:
    """What an archive says of itself, and what is wrong with it. `digest` is that of the list: quote it."""

    site: str
    made_at: str
    digest: str
    n_files: int
    n_receipts: int
    key_ids: tuple[str, ...]
    problems: tuple[Problem, ...]


def write_list(folder: Path, *, site: str, made_at: str) -> None:
    """List the files of a folder, which is an archive from this moment on."""
    document = {"format": FORMAT, "site": site, "made_at": made_at, "files": _digests(folder)}
    (folder / LIST).write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def check(folder: Path, *, keys: bytes | None = None) -> Archive:
    """Hold every file against the list, and every receipt against the keys: those in it unless given.

    Raises `Rejected` for a folder without a list that can be read, and `OSError`.
    """
    listed, there = _list(folder), _digests(folder)
    files: dict[str, str] = listed["files"]
    receipts = sorted(name for name in there if name.startswith(f"{RECEIPTS}/"))
    problems = [
        Problem(code, f"The file is {code}; expected what {LIST} has.", name)
        for name in sorted({*files, *there})
        if files.get(name) != there.get(name)
        for code in ["missing" if name not in there else "changed" if name in files else "additional"]
    ]
    where = KEYS if keys is None else "--keys"
    if keys is None:
        keys = (folder / KEYS).read_bytes() if KEYS in there else b""
    try:
        known = read_keys(keys)
        for where in receipts:
            try:
                verify((folder / where).read_bytes(), known)
            except NotVerified as fault:
                problems.append(Problem(fault.code, str(fault), where))
    except NotVerified as fault:
        known = {}
        problems.append(Problem(fault.code, str(fault), where))
    return Archive(
        site=str(listed["site"]),
        made_at=str(listed["made_at"]),
        digest=_digest(folder / LIST),
        n_files=len(files),
        n_receipts=len(receipts),
        key_ids=tuple(known),
        problems=tuple(problems),
    )


def _list(folder: Path) -> dict[str, Any]:
    try:
        document: dict[str, Any] = json.loads((folder / LIST).read_bytes())
        if document["format"] == FORMAT and document["files"].keys() and document["site"]:
            return document
    except (FileNotFoundError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        pass
    message = f"The folder has no {LIST} of the format {FORMAT}, or a damaged one; expected an archive."
    raise Rejected([Problem("unreadable", message)])


def _digests(folder: Path) -> dict[str, str]:
    paths = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*")}
    return {name: _digest(path) for name, path in sorted(paths.items()) if path.is_file() and name != LIST}


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return f"sha256:{hashlib.file_digest(file, 'sha256').hexdigest()}"
