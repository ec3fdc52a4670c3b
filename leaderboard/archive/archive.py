"""Make an archive: every public board with its manifest and receipts, the tables of the paper, and the docs.

What is in it is what everybody sees, at one moment: an anonymous method has its pseudonym and no receipt.
"""

import json
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from django.conf import settings
from django.contrib.auth.models import AnonymousUser
from django.template.loader import render_to_string

from evaluator import archives
from evaluator.metrics.protocol import grouped_names, range_of
from evaluator.tables import layouts, published
from leaderboard.api.serializers import BoardSerializer, absolute
from leaderboard.backups import contents, database
from leaderboard.backups.contents import NoBackup
from leaderboard.boards import listing, snapshots
from leaderboard.boards.rows import Entry
from leaderboard.exports import tables
from leaderboard.models import Edition, Split, Submission, Visibility
from leaderboard.pages import texts
from leaderboard.storage import files
from leaderboard.submissions import receipts

_ROOT: Final = Path(settings.BASE_DIR)
_COPIED: Final = ("CHANGELOG.md", "docs/**/*.md", "docs/**/*.svg")
_STYLES: Final = (_ROOT / "static" / "site.css", Path(__file__).with_name("index.css"))
# The other pages of a site name persons, or are about the server.
_PAGES: Final = ("rules", "licence")

Files = dict[str, bytes]


def make(*, into: str, now: datetime) -> Path:
    """Write an archive into a folder that is empty or new, and return it. Raises `NoBackup` and `OSError`."""
    contents.require_receipt_key()
    folder = contents.folder_of(into)
    for path in [folder] if folder.is_file() else folder.glob("*"):
        raise NoBackup(f"There is {path}; expected an empty or a new folder.")
    with database.one_moment():
        written, boards = _texts(now), []
        for split in snapshots.splits():
            editions = snapshots.editions().filter(split=split).order_by("-number")
            boards += [_board(split, edition, written) for edition in editions or [None]]
    context = {"boards": boards, "now": now, "benchmark": settings.BENCHMARK, "site_url": settings.SITE_URL}
    context |= {"papers": _papers(), "site_pages": _PAGES}
    written["index.html"] = render_to_string("archive/index.html", context).encode()
    for name, data in written.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    archives.write_list(folder, site=settings.SITE_URL, made_at=now.isoformat(timespec="seconds"))
    return folder


def _board(split: Split, edition: Edition | None, written: Files) -> dict[str, Any]:
    """Add the files of a board to `written`, and return what the index shows of it. Raises `OSError`."""
    board = listing.board(split=split, edition=edition, viewer=AnonymousUser())
    address = absolute("edition", split.pk, edition.number) if edition else absolute("board", split.pk)
    stem = f"boards/{split.pk}/{f'edition-{edition.number}' if edition else 'quoted'}"
    answer = _json(BoardSerializer(board, context={"has_intervals": True}).data)
    links: dict[str, str] = {}
    for each in tables.offered():
        links[each.title] = name = f"{stem}.{each.suffix}"
        export = tables.export(board, address=address, has_intervals=each.has_values)
        written[name] = each.write(export).encode() if each.write else answer
    if edition is not None:
        links["Manifest"] = files.manifest_name(edition.ground_truth.manifest_digest)
        with files.store().open(links["Manifest"], "rb") as file:
            written[links["Manifest"]] = file.read()
    export = tables.export(board, address=address, has_intervals=True)
    shown = [entry for entry in board.entries if entry.withdrawn_at is None]
    scored = [_receipt(entry, edition, written) for entry in shown]
    return {
        "split": split,
        "edition": edition,
        "about": layouts.about(export.origin),
        "links": links,
        "groups": [(metric.heading, len(names)) for metric, names in grouped_names(export.scores).items()],
        "ranges": [range_of(name) for name in export.scores],
        "rows": list(zip(export.rows, shown, scored, strict=True)),
        "has_intervals": any(entry.intervals for entry in shown),
    }


def _receipt(entry: Entry, edition: Edition | None, written: Files) -> str:
    """Add the receipt of a row under its own name. Returns its path; empty where there is none."""
    if edition is None or entry.submission_id is None or entry.visibility != Visibility.PUBLIC:
        return ""
    submission = Submission.objects.select_related("method").get(pk=entry.submission_id)
    name = f"{archives.RECEIPTS}/{submission.pk}-edition-{edition.number}.jwt"
    written[name] = receipts.receipt(submission=submission, edition_number=edition.number).encode()
    return name


def _texts(now: datetime) -> Files:
    """Return keys of receipts, metadata for Zenodo, tables of the paper, pages, docs and styles."""
    written = {archives.KEYS: _json(receipts.public_keys()), ".zenodo.json": _json(_zenodo(now))}
    for table in _papers():
        written[f"paper/{table.table.name}.csv"] = published.as_csv(table).encode()
        written[f"paper/{table.table.name}.tex"] = published.as_latex(table).encode()
    for name in _PAGES:
        edited = texts.current(name)
        written[f"pages/{name}.md"] = (edited.text if edited else texts.default_text(name)).encode()
    for path in sorted(path for pattern in _COPIED for path in _ROOT.glob(pattern)):
        written[path.relative_to(_ROOT).as_posix()] = path.read_bytes()
    return written | {path.name: path.read_bytes() for path in _STYLES}


def _papers() -> tuple[published.PrintedTable, ...]:
    return published.printed_tables() if settings.BENCHMARK.has_paper_tables else ()


def _zenodo(now: datetime) -> dict[str, Any]:
    """Return the metadata of a deposit, for `.zenodo.json`; maintainers complete creators and licence."""
    return {
        "title": f"{settings.BENCHMARK.site_name}: boards of {now:%Y-%m-%d}",
        "description": f"<p>The public boards of {settings.SITE_URL}, with manifests, signed receipts and "
        "documents. index.html shows them; pages/licence.md says what others may do with them.</p>",
        "upload_type": "dataset",
        "creators": [{"name": settings.BENCHMARK.site_name}],
        "publication_date": f"{now:%Y-%m-%d}",
        "access_right": "open",
        "license": "other-open",
        "keywords": list(settings.BENCHMARK.keywords),
        "related_identifiers": [
            {"identifier": settings.BENCHMARK.dataset.url, "relation": "isSupplementTo"},
            {"identifier": settings.SITE_URL, "relation": "isDerivedFrom"},
        ],
    }


def _json(document: object) -> bytes:
    return (json.dumps(document, indent=1, ensure_ascii=False) + "\n").encode()
