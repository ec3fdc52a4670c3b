"""The splits and the published results that the benchmark has from the start."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import msgspec
from django.conf import settings
from django.db import transaction
from django.db.models import QuerySet
from django.utils import timezone

from evaluator.papers.tables import published_tables
from leaderboard import audit, board_versions
from leaderboard.editions import papers
from leaderboard.editions.policy import HIDDEN_QUOTA
from leaderboard.errors.refusals import Refused, clean_text, require_maintainer
from leaderboard.models import Method, PublishedResult, Split, User, Visibility
from leaderboard.models.benchmark import SINCE_EVER
from leaderboard.people.names import confusable_with

PUBLISHED_DIR = Path(__file__).parent / "published"
MAX_REASON: Final = 500


def ensure_splits(*, split_model: Any = Split, result_model: Any = PublishedResult) -> None:
    """Make the benchmark's first splits and the rows of its paper where they are missing.

    In production no simulated split is made: only `make demo` fills it.

    Rows of a new split are there since ever, later ones since now. A migration passes its own models.
    """
    benchmark, now = settings.BENCHMARK, timezone.now()
    made = set()
    with transaction.atomic():
        for position, first in enumerate(benchmark.splits):
            if settings.PRODUCTION and first.is_simulated:
                continue
            fields: dict[str, Any] = {
                "position": position,
                "decimals": 1 if first.is_hidden else 2,
                **msgspec.structs.asdict(first),
                **(HIDDEN_QUOTA if first.is_hidden else {}),
            }
            _, is_new = split_model.objects.get_or_create(name=first.name, defaults=fields)
            made |= {first.name} if is_new else set()
        known = [first.name for first in benchmark.splits]
        for path in sorted(PUBLISHED_DIR.glob("*.json")) if benchmark.has_paper_tables else ():
            for row in papers.rows_of(_with_results(papers.parse(path.read_bytes())), splits=known, now=now):
                names = {"split_id": row.pop("split_id"), "slug": row.pop("slug")}
                row["added_at"] = SINCE_EVER if names["split_id"] in made else now
                if not result_model.objects.filter(**names).exists():
                    result_model.objects.create(**names, **row)


def _with_results(document: Mapping[str, Any]) -> dict[str, Any]:
    # `results_of` names the table of the paper that has the numbers.
    table = published_tables().table(document["results_of"])
    results: dict[str, dict[str, list[Any]]] = {}
    for row in table.rows:
        results.setdefault(row.split or "", {})[row.method or ""] = list(row.values)
    return {**document, "columns": list(table.columns), "results": results}


@dataclass(frozen=True)
class Imported:
    """What became of the rows of a document, each as `split/slug`."""

    added: tuple[str, ...] = ()
    replaced: tuple[str, ...] = ()
    unchanged: tuple[str, ...] = ()


def import_published(
    *, document: Mapping[str, Any], now: datetime, is_replacing: bool = False, actor: User | None = None
) -> Imported:
    """Put all rows of a paper on the boards from now on, or none.

    A row with other content is replaced with `is_replacing`; boards of the past keep the former one.
    `actor` None is the command line. Raises `Refused`, `papers.BadDocument` and `NotMaintainer`.
    """
    require_maintainer(actor, to="add rows of papers")
    rows = papers.rows_of(document, splits=Split.objects.values_list("name", flat=True), now=now)
    names_by_outcome: dict[str, list[str]] = {"added": [], "replaced": [], "unchanged": []}
    with transaction.atomic():
        for row in rows:
            outcome = _import_row(row, now=now, is_replacing=is_replacing)
            names_by_outcome[outcome].append(f"{row['split_id']}/{row['slug']}")
        split_ids = sorted({row["split_id"] for row in rows})
        _require_names_of_their_own(rows, outcomes=names_by_outcome)
        if names_by_outcome["added"] or names_by_outcome["replaced"]:
            audit.record(
                verb="imported",
                noun="PublishedResult",
                noun_id=str(rows[0]["source_url"])[:80],
                actor=actor,
                details={"added": names_by_outcome["added"], "replaced": names_by_outcome["replaced"]},
            )
            for split_id in split_ids:
                board_versions.bump(split_id)
    return Imported(**{outcome: tuple(names) for outcome, names in names_by_outcome.items()})


def remove_published(
    *, split_name: str, slug: str, reason: str, now: datetime, actor: User | None = None
) -> PublishedResult:
    """Take a published result off the board from now on; boards of the past keep it.

    `actor` None is the command line. Raises `NotMaintainer`, and `Refused` without a reason or such a row.
    """
    require_maintainer(actor, to="remove rows of papers")
    reason = clean_text("reason", reason, limit=MAX_REASON)
    with transaction.atomic():
        current = PublishedResult.objects.select_for_update(no_key=True).filter(replaced_at=None)
        row = current.filter(split=split_name, slug=slug).first()
        if row is None:
            known = ", ".join(sorted(current.filter(split=split_name).values_list("slug", flat=True)))
            raise Refused(
                "bad-value",
                f"The board of {split_name[:80]!r} quotes no row {slug[:80]!r}; "
                f"expected one of {known or 'none'}.",
            )
        row.replaced_at = now
        row.save(update_fields=["replaced_at"])
        audit.record(
            verb="removed",
            noun="PublishedResult",
            noun_id=f"{split_name}/{slug}"[:80],
            actor=actor,
            details={"reason": reason},
        )
        board_versions.bump(split_name)
    return row


def quoted() -> QuerySet[PublishedResult]:
    """Return the published results on the boards now, by split, newest first."""
    rows = PublishedResult.objects.filter(replaced_at=None).select_related("split")
    return rows.order_by("split__position", "split", "-added_at", "pk")


def _require_names_of_their_own(
    rows: Iterable[Mapping[str, Any]], *, outcomes: Mapping[str, Sequence[str]]
) -> None:
    """Raise `Refused` for a new row whose name looks like another one on its board."""
    new = [row for row in rows if f"{row['split_id']}/{row['slug']}" not in outcomes["unchanged"]]
    if not new:
        return
    # Whoever shows a name holds this until it is shown. The rows are written: whoever comes later sees them.
    board_versions.lock()
    public = Method.objects.filter(visibility=Visibility.PUBLIC).values_list("name", flat=True)
    current = PublishedResult.objects.filter(replaced_at=None)
    for row in new:
        others = current.filter(split=row["split_id"]).exclude(slug=row["slug"])
        name = row["method_name"]
        twin = confusable_with(name, [*public, *others.values_list("method_name", flat=True)])
        if twin is not None:
            raise Refused(
                "name-taken",
                f"The row {row['slug']!r} of the board of {row['split_id']} has the name {name!r}, which "
                f"looks like {twin!r} there; expected another name, such as one with the year of the paper.",
                field="file",
            )


def _import_row(row: Mapping[str, Any], *, now: datetime, is_replacing: bool) -> str:
    current = PublishedResult.objects.select_for_update(no_key=True).filter(replaced_at=None)
    there = current.filter(split=row["split_id"], slug=row["slug"]).first()
    if there is not None:
        changed = sorted(name for name, value in row.items() if getattr(there, name) != value)
        if not changed:
            return "unchanged"
        if not is_replacing:
            raise Refused(
                "bad-value",
                f"The board of {row['split_id']} already has the row {row['slug']!r}, which differs in "
                f"{', '.join(changed)}; expected the same content, or the choice to replace it (--replace).",
                field="is_replacing",
            )
        PublishedResult.objects.filter(pk=there.pk).update(replaced_at=now)
    PublishedResult.objects.create(**row, added_at=now)
    return "added" if there is None else "replaced"
