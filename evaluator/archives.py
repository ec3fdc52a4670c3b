"""Archives of a leaderboard: folders of its public results, which outlive the server.

A list in the folder has the digest of every other file, so damage is found without the server.
"""

from __future__ import annotations

import json
from hashlib import sha256
from pathlib import Path
from typing import Any, Final, NamedTuple

from evaluator.hidden_files import is_hidden
from evaluator.problems import Problem, Rejected
from evaluator.receipts import NotVerified, read_keys, verify

LIST: Final = "archive.json"
KEYS: Final = "receipt-keys.json"
RECEIPTS: Final = "receipts"
FORMAT: Final = 1


class Archive(NamedTuple):
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
    files = _digests(folder)
    files.pop(LIST, None)
    document = {"format": FORMAT, "site": site, "made_at": made_at, "files": files}
    (folder / LIST).write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def check(folder: Path, *, keys: bytes | None = None) -> Archive:
    """Hold every file against the list, and every receipt against the keys: those in it unless given.

    Raises `Rejected` for a folder without a list that can be read, and `OSError`.
    """
    (files, site, made_at), there = _list(folder), _digests(folder)
    digest = there.pop(LIST)
    receipts = [name for name in there if name.startswith(f"{RECEIPTS}/")]
    problems = [
        Problem(code, f"The file is {code}; expected what {LIST} has.", name)
        for name in sorted({*files, *there})
        if files.get(name) != there.get(name)
        for code in ["missing" if name not in there else "changed" if name in files else "additional"]
    ]
    source = KEYS if keys is None else "--keys"
    if keys is None:
        keys = (folder / KEYS).read_bytes() if KEYS in there else b""
    known: dict[str, Any] = {}
    for where in [source, *receipts]:
        try:
            if where == source:
                known = read_keys(keys)
            elif known:
                verify((folder / where).read_bytes(), known)
        except NotVerified as fault:
            problems.append(Problem(fault.code, str(fault), where))
    return Archive(
        site=site,
        made_at=made_at,
        digest=digest,
        n_files=len(files),
        n_receipts=len(receipts),
        key_ids=tuple(known),
        problems=tuple(problems),
    )


def _list(folder: Path) -> tuple[dict[str, str], str, str]:
    try:
        document = json.loads((folder / LIST).read_bytes())
        if document["format"] == FORMAT and document["files"]:
            return dict(document["files"]), str(document["site"]), str(document["made_at"])
    except (FileNotFoundError, ValueError, LookupError, TypeError, RecursionError):
        pass
    message = f"The folder has no {LIST} of the format {FORMAT}, or a damaged one; expected an archive."
    raise Rejected([Problem("unreadable", message)])


def _digests(folder: Path) -> dict[str, str]:
    files = [path for path in folder.rglob("*") if path.is_file()]
    names = {path: path.relative_to(folder) for path in files}
    paths = {names[path].as_posix(): path for path in files if not is_hidden(names[path])}
    return {name: f"sha256:{sha256(paths[name].read_bytes()).hexdigest()}" for name in sorted(paths)}
