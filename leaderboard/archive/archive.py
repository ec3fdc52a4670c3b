"""Make an archive: every public board with its manifest and receipts, the tables of the paper, and the docs.

What is in it is what everybody sees, at one moment: an anonymous method has its pseudonym and no receipt.
"""

import json
from collections.abc import Sequence
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

_COPIED: Final = ("CHANGELOG.md", "docs/**/*.md", "docs/**/*.svg")
# The other pages of a site name persons, or are about the server.
_PAGES: Final = ("rules", "licence")


def make(*, into: str, now: datetime) -> Path:
    """Write an archive into a folder that is empty or new, and return it. Raises `NoBackup` and `OSError`."""
    if not settings.HAS_RECEIPT_KEY:
        raise NoBackup(
            "TSTTC_RECEIPT_KEY is not set; expected it here, since an archive has signed receipts."
        )
    folder = contents.folder_of(into)
    for path in [folder] if folder.is_file() else folder.glob("*"):
        raise NoBackup(f"There is {path}; expected an empty or a new folder.")
    papers = published.printed_tables() if settings.BENCHMARK.has_paper_tables else ()
    with database.one_moment():
        written, boards = _texts(papers, now), []
        for split in snapshots.splits():
            editions = snapshots.editions().filter(split=split).order_by("-number")
            boards += [_board(split, edition, written) for edition in editions or [None]]
    context = {"boards": boards, "papers": papers, "site_pages": _PAGES, "now": now}
    context |= {"benchmark": settings.BENCHMARK, "site_url": settings.SITE_URL}
    written["index.html"] = render_to_string("archive/index.html", context).encode()
    for name, data in written.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    archives.write_list(folder, site=settings.SITE_URL, made_at=now.isoformat(timespec="seconds"))
    return folder


def _board(split: Split, edition: Edition | None, written: dict[str, bytes]) -> dict[str, Any]:
    """Add the files of a board to `written`, and return what the index shows of it. Raises `OSError`."""
    board = listing.board(split=split, edition=edition, viewer=AnonymousUser())
    address = absolute("edition", split.pk, edition.number) if edition else absolute("board", split.pk)
    stem = f"boards/{split.pk}/{f'edition-{edition.number}' if edition else 'quoted'}"
    answer = _json(
        BoardSerializer(board, context={"has_intervals": True, "explained_by": board.edition}).data
    )
    links: dict[str, str] = {}
    for each in tables.offered():
        links[each.title] = name = f"{stem}.{each.suffix}"
        export = tables.export(board, address=address, has_intervals=each.has_values)
        written[name] = each.write(export).encode() if each.write else answer
    if edition is not None:
        links["Manifest"] = files.manifest_name(edition.ground_truth.manifest_digest)
        with files.open_named(links["Manifest"]) as file:
            written[links["Manifest"]] = file.read()
    export = tables.export(board, address=address, has_intervals=True)
    shown, rows = [entry for entry in board.entries if entry.withdrawn_at is None], []
    for row, entry in zip(export.rows, shown, strict=True):
        name = ""
        if edition and entry.submission_id and entry.visibility == Visibility.PUBLIC:
            name = f"{archives.RECEIPTS}/{entry.submission_id}-edition-{edition.number}.jwt"
            submission = Submission.objects.select_related("method").get(pk=entry.submission_id)
            written[name] = receipts.receipt(submission=submission, edition_number=edition.number).encode()
        rows.append((row, entry, _about(row, entry), name))
    return {
        "split": split,
        "edition": edition,
        "is_current": edition == split.current_edition,
        "title": f"{split.title}, edition {edition.number}" if edition else split.title,
        "about": layouts.about(export.origin),
        "links": links,
        "groups": [(metric.heading, len(names)) for metric, names in grouped_names(export.scores).items()],
        "ranges": [range_of(name) for name in export.scores],
        "rows": rows,
        "has_intervals": any(entry.intervals for entry in shown),
    }


def _about(row: layouts.Row, entry: Entry) -> str:
    """Say whose row it is, of when, and whether a paper has it."""
    source = "quoted" if entry.kind == "published" else ""
    return ", ".join(filter(None, (row.team, entry.date_text, source)))


def _texts(papers: Sequence[published.PrintedTable], now: datetime) -> dict[str, bytes]:
    """Return keys of receipts, metadata for Zenodo, tables of the paper, pages, docs and styles."""
    benchmark, root = settings.BENCHMARK, Path(settings.BASE_DIR)
    # Maintainers complete creators and licence.
    deposit = {
        "title": f"{benchmark.site_name}: boards of {now:%Y-%m-%d}",
        "description": f"<p>The public boards of {settings.SITE_URL}, with manifests, signed receipts and "
        "documents. index.html shows them; pages/licence.md says what others may do with them.</p>",
        "upload_type": "dataset",
        "creators": [{"name": benchmark.site_name}],
        "publication_date": f"{now:%Y-%m-%d}",
        "license": "other-open",
        "keywords": list(benchmark.keywords),
        "related_identifiers": [
            {"identifier": benchmark.dataset.url, "relation": "isSupplementTo"},
            {"identifier": settings.SITE_URL, "relation": "isDerivedFrom"},
        ],
    }
    written = {archives.KEYS: _json(receipts.public_keys()), ".zenodo.json": _json(deposit)}
    for table in papers:
        written[f"paper/{table.table.name}.csv"] = published.as_csv(table).encode()
        written[f"paper/{table.table.name}.tex"] = published.as_latex(table).encode()
    for name in _PAGES:
        edited = texts.current(name)
        written[f"pages/{name}.md"] = (edited.text if edited else texts.default_text(name)).encode()
    copied = {path.relative_to(root).as_posix(): path for each in _COPIED for path in root.glob(each)}
    copied |= {"site.css": root / "static/site.css", "index.css": Path(__file__).with_name("index.css")}
    return written | {name: path.read_bytes() for name, path in copied.items()}


def _json(document: object) -> bytes:
    return (json.dumps(document, indent=1, ensure_ascii=False) + "\n").encode()
