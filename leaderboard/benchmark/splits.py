"""The splits that the benchmark has from the start, and the rows quoted from papers."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from django.core.exceptions import ValidationError
from django.db import transaction
from django.utils import timezone

from evaluator.metrics.protocol import PROTOCOLS, SCORE_NAMES
from leaderboard import audit, versions
from leaderboard.errors.refusals import Refused
from leaderboard.models import PublishedResult, Split, User
from leaderboard.models.benchmark import SINCE_EVER

PUBLISHED_DIR = Path(__file__).parent / "published"

SPLITS: tuple[dict[str, Any], ...] = (
    {
        "name": "test",
        "title": "Test",
        "description": "The hidden test set: the numbers that papers quote.",
        "position": 0,
        "is_hidden": True,
        "decimals": 1,
        "quota_limit": 3,
        "quota_window": timedelta(days=30),
        "quota_min_gap": timedelta(hours=24),
    },
    {
        "name": "val",
        "title": "Validation",
        "description": "The validation set, whose ground truth comes with the dataset.",
        "position": 1,
        "is_hidden": False,
        "decimals": 2,
        "quota_limit": 50,
    },
    {
        "name": "demo",
        "title": "Demo",
        "description": "Simulated data, for testing only.",
        "position": 2,
        "is_hidden": False,
        "is_simulated": True,
        "decimals": 2,
        "quota_limit": 20,
    },
)


def ensure_splits(*, split_model: Any = Split, result_model: Any = PublishedResult) -> None:
    """Make the three splits and the published rows where they are missing; change nothing that is there.

    Rows that come with their split stand there since ever; those that come later, since now. A migration
    passes the models as they were in its time, without what came later.
    """
    now = timezone.now()
    columns = {field.name for field in split_model._meta.get_fields()}
    has_times = any(field.name == "added_at" for field in result_model._meta.get_fields())
    made = set()
    with transaction.atomic():
        for fields in SPLITS:
            there = {name: value for name, value in fields.items() if name in columns}
            _, is_new = split_model.objects.get_or_create(name=fields["name"], defaults=there)
            made |= {fields["name"]} if is_new else set()
        for path in sorted(PUBLISHED_DIR.glob("*.json")):
            for row in _rows_of(json.loads(path.read_text(encoding="utf-8"))):
                names = {"split_id": row.pop("split_id"), "slug": row.pop("slug")}
                if has_times:
                    row["added_at"] = SINCE_EVER if names["split_id"] in made else now
                if not result_model.objects.filter(**names).exists():
                    result_model.objects.create(**names, **row)


@dataclass(frozen=True)
class Imported:
    """What became of the rows of a document, each as `split/slug`."""

    added: tuple[str, ...] = ()
    replaced: tuple[str, ...] = ()
    unchanged: tuple[str, ...] = ()


def import_published(
    *, document: Mapping[str, Any], now: datetime, is_replacing: bool = False, actor: User | None = None
) -> Imported:
    """Put the rows of one paper on the boards from now on, all or none of them.

    A row that is there with the same content stays. One with other content is replaced, which boards of the
    past do not notice. Raises `Refused` for that unless `is_replacing`, and for what is no such document.
    """
    rows = _sound_rows(document)
    found: dict[str, list[str]] = {"added": [], "replaced": [], "unchanged": []}
    with transaction.atomic():
        for row in rows:
            outcome = _import_row(row, now=now, is_replacing=is_replacing)
            found[outcome].append(f"{row['split_id']}/{row['slug']}")
        split_ids = sorted({row["split_id"] for row in rows})
        if found["added"] or found["replaced"]:
            audit.record(
                verb="imported",
                noun="PublishedResult",
                noun_id=str(rows[0]["source_url"])[:80],
                actor=actor,
                details={"added": found["added"], "replaced": found["replaced"]},
            )
            for split_id in split_ids:
                versions.changed(split_id)
    return Imported(**{outcome: tuple(names) for outcome, names in found.items()})


def _import_row(row: Mapping[str, Any], *, now: datetime, is_replacing: bool) -> str:
    """Add or replace one row. Returns which of the two was done, or that it is unchanged."""
    standing = PublishedResult.objects.select_for_update(no_key=True).filter(replaced_at=None)
    there = standing.filter(split=row["split_id"], slug=row["slug"]).first()
    if there is not None:
        changed = sorted(name for name, value in row.items() if getattr(there, name) != value)
        if not changed:
            return "unchanged"
        if not is_replacing:
            raise Refused(
                "bad-value",
                f"The row {row['slug']!r} of {row['split_id']} is there with another {', '.join(changed)}; "
                "expected the same, or --replace.",
            )
        PublishedResult.objects.filter(pk=there.pk).update(replaced_at=now)
    PublishedResult.objects.create(**row, added_at=now)
    return "added" if there is None else "replaced"


def _sound_rows(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The rows of a document, each as one that can be kept. Raises `Refused`."""
    try:
        rows = list(_rows_of(document))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise Refused(
            "bad-value",
            f"The document lacks {error} or has it in another form; expected one such as those in "
            "leaderboard/benchmark/published/.",
        ) from None
    known = set(Split.objects.values_list("name", flat=True))
    for row in rows:
        if row["split_id"] not in known:
            expected = ", ".join(sorted(known))
            raise Refused(
                "unknown-split", f"There is no split {row['split_id']!r}; expected one of {expected}."
            )
        if not _are_named(row["scores"]) or not all(map(_is_score, row["scores"].values())):
            raise Refused(
                "bad-value",
                f"The values of the row {row['slug']!r} of {row['split_id']} are no numbers from 0, one for "
                f"each name of a protocol; expected one or null for each of {', '.join(SCORE_NAMES)}.",
            )
        try:
            PublishedResult(**row).full_clean(validate_unique=False, validate_constraints=False)
        except ValidationError as error:
            [field, *_] = error.message_dict
            said = error.message_dict[field][0]
            raise Refused("bad-value", f"The row {row['slug']!r}: the field {field!r}: {said}") from None
    if not rows:
        raise Refused("bad-value", "The document has no rows; expected some under 'results'.")
    return rows


def _are_named(scores: Mapping[str, object]) -> bool:
    return any(scores.keys() == set(protocol.score_names) for protocol in PROTOCOLS.values())


def _is_score(value: object) -> bool:
    if value is None:
        return True
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value < math.inf


def _rows_of(document: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """The rows of one paper's main table; see `leaderboard/benchmark/published/` for the form."""
    source = document["source"]
    methods = {method["slug"]: method for method in document["methods"]}
    for split_name, rows in document["results"].items():
        for slug, values in rows.items():
            method = methods[slug]
            yield {
                "split_id": split_name,
                "slug": slug,
                "method_name": method["name"],
                "description": method["description"],
                "authors": source["authors"],
                "source_title": source["title"],
                "source_url": source["url"],
                "source_table": source["table"],
                "code_url": source["code"],
                "year": source["year"],
                "uses_nerf": method["uses_nerf"],
                "latency_ms": method["latency_ms"],
                "hardware": "one RTX 3090, batch 1, FP16" if method["latency_ms"] else "",
                "scores": dict(zip(document["columns"], values, strict=True)),
            }
