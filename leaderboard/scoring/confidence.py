"""Uncertainty of an edition: a confidence interval for every value, a rank range for every rank.

Workers make them from sums per recording, which never leave the workers' private directory, and write them
beside the scores. An interval belongs to one evaluation and stays; ranges belong to all entries of a board
and are made anew when those change. Which entries an edition's ranges were made of is kept as a digest, so
that anybody can see whether they still hold: the database is the truth, and messages only make it quick.
`docs/uncertainty.md` says how and why.
"""

import hashlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import lru_cache
from uuid import UUID

import numpy as np
import structlog
from django.db import connection, transaction
from django.db.models import Exists, OuterRef
from numpy.typing import NDArray

from evaluator import published, uncertainty
from evaluator.protocol import SCORE_NAMES
from evaluator.ranges import Quoted, rank_ranges
from evaluator.significance import MIN_DEGREES, cut_off, too_few_recordings
from leaderboard import bags, boards, bulk, disclosure, seeds
from leaderboard.entries import printed_decimals
from leaderboard.models import Edition, Evaluation, PublishedResult, Score, SentFile, Status, Visibility

log = structlog.get_logger(__name__)

Floats = NDArray[np.float64]
# Every digest begins with it. Raised when intervals or ranges are made in another way: all are made anew.
METHOD = "3"
# While an edition is being scored its entries change all the time; its ranges follow once a minute.
PATIENCE = timedelta(minutes=1)
# All pairs are compared, so the work grows with their number: two seconds of rest for 200 entries.
REST_PER_PAIR = timedelta(microseconds=60)
LOCKS = 0x7753
COLUMNS = ("low", "high", "rank_low", "rank_high", "is_with_best")
Values = tuple[float | None, float | None, int | None, int | None, bool | None]
NOTHING: Values = (None, None, None, None, None)


@dataclass(frozen=True)
class Standing:
    """A scored submission in an edition that its team has not withdrawn."""

    evaluation_id: UUID
    file: SentFile
    method_id: UUID
    is_shown: bool
    value: float  # its MiD, as published
    submitted_at: datetime


def why_no_interval(edition: Edition) -> str:
    """Why nothing in this edition has an interval, a rank range or a p-value; "" where some have.

    A worker finds out how many recordings an edition effectively has, and writes it beside the edition; until
    then only an edition with too few recordings in all is known to have none.
    """
    known = [edition.n_effective.get(name, 0.0) for name in SCORE_NAMES] if edition.n_effective else []
    most = max(known, default=float(edition.ground_truth.n_recordings))
    if most >= MIN_DEGREES:
        return ""
    return f"There are no intervals: they would be made of {too_few_recordings(most)}."


def generator_of(edition: Edition, *, purpose: str) -> np.random.Generator:
    """The random numbers of an edition: everything that is drawn for it comes from here."""
    return uncertainty.generator_of(seed_of(edition), purpose=purpose)


def seed_of(edition: Edition) -> str:
    """What the random numbers of an edition are made of; each purpose then has its own.

    Raises `OSError` of a hidden split without its secret.
    """
    return seeds.seed_of(edition)


# --- which entries ---------------------------------------------------------------------------------------


def standing(edition: Edition) -> list[Standing]:
    """Everything that stands in an edition, private methods included: one query."""
    rows = Score.objects.filter(
        evaluation__edition=edition,
        evaluation__status=Status.SCORED,
        evaluation__submission__withdrawn_at=None,
        metric="mid",
        interval="overall",
    ).values_list(
        "evaluation_id",
        "evaluation__submission__digest",
        "evaluation__submission__manifest_digest",
        "evaluation__submission__method_id",
        "evaluation__submission__method__visibility",
        "value",
        "evaluation__submission__submitted_at",
    )
    return [
        Standing(pk, SentFile(digest, manifest), method, visibility != Visibility.PRIVATE, value, at)
        for pk, digest, manifest, method, visibility, value, at in rows
    ]


def ranked(rows: Sequence[Standing]) -> list[Standing]:
    """What everybody sees ranked: of each shown method its best, the earlier one of two that are as good."""
    best: dict[UUID, Standing] = {}
    for row in sorted(rows, key=lambda row: (row.value, row.submitted_at)):
        if row.is_shown:
            best.setdefault(row.method_id, row)
    return list(best.values())


def digest_of(edition: Edition, rows: Sequence[Standing]) -> str:
    """Names what intervals and ranges are made of. It knows of private entries: for nobody's eyes."""
    rivals = {row.evaluation_id for row in ranked(rows)}
    lines = sorted(f"{row.evaluation_id} {row.evaluation_id in rivals}" for row in rows)
    printed = sorted(map(repr, _printed(edition)))
    text = "\n".join([edition.ground_truth_id, edition.protocol, *printed, *lines])
    return f"{METHOD} sha256:{hashlib.sha256(text.encode()).hexdigest()}"


def _printed(edition: Edition) -> list[tuple[float, ...]]:
    """The ten numbers of each row on its board that is quoted from a paper; NaN where it has none."""
    rows = PublishedResult.objects.on_board(edition.split, edition).values_list("scores", flat=True)
    return [tuple(float(scores.get(name) or "nan") for name in SCORE_NAMES) for scores in rows]


def stale(*, now: datetime, held: Collection[str] | None) -> list[Edition]:
    """Editions whose entries are not those that their ranges were made of.

    With `held` only those whose ground truth is among these digests: what this worker can do. An edition in
    which something is still to be scored has patience, and so has a large one whose ranges are quite new.
    """
    undecided = Evaluation.objects.filter(edition=OuterRef("pk"), status__in=[Status.QUEUED, Status.RUNNING])
    found = (
        Edition.objects.filter(discarded_at=None)
        .select_related("ground_truth", "split")
        .annotate(is_busy=Exists(undecided))
        .order_by("pk")
    )
    if held is not None:
        found = found.filter(ground_truth__in=held)
    return [edition for edition in found if _is_stale(edition, now=now)]


def _is_stale(edition: Edition, *, now: datetime) -> bool:
    if edition.is_busy and now - (edition.inferred_at or edition.opened_at) < PATIENCE:  # type: ignore[attr-defined]  # annotated above
        return False
    rows = standing(edition)
    rest = min(PATIENCE, len(rows) ** 2 * REST_PER_PAIR)
    is_new = edition.inferred_at is not None and now - edition.inferred_at < rest
    return not is_new and not _holds(edition, digest=digest_of(edition, rows))


def _holds(edition: Edition, *, digest: str) -> bool:
    """Whether all that workers make of an edition beside its scores is there, and of these entries."""
    return edition.floor is not None and edition.inference_digest == digest


# --- a worker's work -------------------------------------------------------------------------------------


def infer(*, edition: Edition, now: datetime, between: Callable[[], None] = lambda: None) -> bool:
    """Make what is missing of an edition's intervals, and its rank ranges anew. Whether it wrote them.

    False: they hold already, another worker is at it, or the entries changed meanwhile, and whoever looks
    next does it. `between` is called every fraction of a second. Raises what `bags.sums_of` raises.
    """
    with _alone(edition) as is_alone:
        rows = standing(edition)
        digest = digest_of(edition, rows)
        if not is_alone or _holds(edition, digest=digest):
            return False
        inferred = _inferred(edition, rows, between=between)
        is_written = _write(edition, digest=digest, inferred=inferred, rows=rows, now=now)
    log.info("inferred", edition=str(edition), n_entries=len(rows), is_written=is_written)
    return is_written


@contextmanager
def _alone(edition: Edition) -> Iterator[bool]:
    """Whether this worker is the only one at it: what several compute, all but one throw away."""
    if connection.vendor != "postgresql":
        yield True
        return
    with connection.cursor() as cursor:
        cursor.execute("SELECT pg_try_advisory_lock(%s, %s)", [LOCKS, edition.pk])
        (is_alone,) = cursor.fetchone() or (False,)
        try:
            yield is_alone
        finally:
            if is_alone:
                cursor.execute("SELECT pg_advisory_unlock(%s, %s)", [LOCKS, edition.pk])


def _inferred(
    edition: Edition, rows: Sequence[Standing], *, between: Callable[[], None]
) -> Mapping[int, Values]:
    """What is to stand beside each score of the edition, by the score's id."""
    table = _Table(edition)
    counts = bags.counts_of(edition)
    usable = uncertainty.usable_columns(counts)
    low, high = table.low, table.high
    if not edition.inference_digest.startswith(f"{METHOD} "):
        low[[table.row_of[row.evaluation_id] for row in rows]] = np.nan
    low[:, ~usable], high[:, ~usable] = np.nan, np.nan
    missing = [
        row
        for row in rows
        for i in [table.row_of[row.evaluation_id]]
        if np.isnan(low[i][usable & ~np.isnan(table.value[i])]).any()
    ]
    for start in range(0, len(missing), uncertainty.BATCH):
        between()
        some = missing[start : start + uncertainty.BATCH]
        sums = np.stack([bags.sums_of(edition, file=row.file) for row in some])
        places = [table.row_of[row.evaluation_id] for row in some]
        ends = bootstrap_of(edition).intervals(sums)
        # As they are kept: ranges must not depend on which of them were made before.
        low[places], high[places] = disclosure.published_ends(*ends, edition=edition)
    rivals = ranked(rows)
    places = [table.row_of[row.evaluation_id] for row in rivals]
    rank_low, rank_high = np.zeros(table.value.shape, int), np.zeros(table.value.shape, int)
    if rivals:
        ranges = rank_ranges(
            np.stack([bags.sums_of(edition, file=row.file) for row in rivals]),
            published=table.value[places],
            usable=usable,
            rng=generator_of(edition, purpose="signs"),
            quoted=_quoted(edition, counts),
            between=between,
        )
        rank_low[places], rank_high[places] = ranges.low, ranges.high
    decimals = edition.decimals
    return {
        pk: (
            _published(low[i, j], decimals),
            _published(high[i, j], decimals),
            int(rank_low[i, j]) or None,
            int(rank_high[i, j]) or None,
            bool(rank_low[i, j] == 1) if rank_low[i, j] else None,
        )
        for pk, (i, j) in table.cells.items()
    }


class _Table:
    """The scores of an edition as arrays (evaluations, columns), NaN where there is none."""

    def __init__(self, edition: Edition) -> None:
        scores = list(
            Score.objects.filter(evaluation__edition=edition).values_list(
                "pk", "evaluation_id", "metric", "interval", "value", *COLUMNS
            )
        )
        ids = sorted({score[1] for score in scores})
        self.row_of = {pk: i for i, pk in enumerate(ids)}
        column_of = {name: j for j, name in enumerate(SCORE_NAMES)}
        self.value, self.low, self.high = (np.full((len(ids), len(SCORE_NAMES)), np.nan) for _ in range(3))
        self.cells: dict[int, tuple[int, int]] = {}
        self.before: dict[int, Values] = {}
        for pk, evaluation_id, metric, interval, value, *inferred in scores:
            name = metric if interval == "overall" else f"{metric}_{interval}"
            cell = self.row_of[evaluation_id], column_of[name]
            self.cells[pk] = cell
            self.before[pk] = (inferred[0], inferred[1], inferred[2], inferred[3], inferred[4])
            self.value[cell] = value
            self.low[cell], self.high[cell] = (
                np.nan if end is None else end for end in (inferred[0], inferred[1])
            )


def _n_effective(edition: Edition) -> dict[str, float]:
    """The effective number of recordings of each column, as it is published."""
    degrees = uncertainty.degrees_of(bags.counts_of(edition))
    return {name: cut_off(n) for name, n in zip(SCORE_NAMES, degrees.tolist(), strict=True)}


def _quoted(edition: Edition, counts: Floats) -> Quoted | None:
    """The rows quoted from papers, each value as exact as it was printed: 14.8 is 14.75 to 14.85."""
    values = np.array(_printed(edition)).reshape(-1, len(SCORE_NAMES))
    if not len(values):
        return None
    decimals = [printed_decimals(v for v in row if not np.isnan(v)) for row in values.tolist()]
    half_widths = 0.5 * 10.0 ** -np.array(decimals)[:, None]
    return Quoted(values, np.where(np.isnan(values), np.nan, half_widths), counts)


def _published(value: float, decimals: int) -> float | None:
    return None if np.isnan(value) else published(float(value), decimals=decimals)


def bootstrap_of(edition: Edition) -> uncertainty.Bootstrap:
    """The weights of the edition's ground truth. Raises `OSError` without access to its values."""
    return _bootstrap(seed_of(edition), bags.counts_of(edition).tobytes())


@lru_cache(maxsize=1)
def _bootstrap(seed: str, counts: bytes) -> uncertainty.Bootstrap:
    table = np.frombuffer(counts).reshape(-1, len(SCORE_NAMES))
    return uncertainty.bootstrap_of(seed, table)


def _write(
    edition: Edition,
    *,
    digest: str,
    inferred: Mapping[int, Values],
    rows: Sequence[Standing],
    now: datetime,
) -> bool:
    """Write what was made, all or nothing, if the entries are still the same."""
    shown = {row.evaluation_id for row in rows if row.is_shown}
    floor, n_effective = bags.floor_of(edition), _n_effective(edition)
    with transaction.atomic():
        present = (
            Edition.objects.select_for_update(of=("self",), no_key=True)
            .select_related("ground_truth")
            .get(pk=edition.pk)
        )
        if present.inference_digest != edition.inference_digest or digest != digest_of(
            present, standing(present)
        ):
            return False
        table = _Table(present)
        changed = [(*values, pk) for pk, values in inferred.items() if table.before.get(pk, values) != values]
        bulk.update(Score, COLUMNS, changed)
        Edition.objects.filter(pk=edition.pk).update(
            inferred_at=now, inference_digest=digest, floor=floor, n_effective=n_effective
        )
        ids = {i: pk for pk, i in table.row_of.items()}
        # Whose rows only their own team sees, changes nothing that anybody else is shown.
        is_seen = (floor, n_effective) != (present.floor, present.n_effective) or any(
            ids[table.cells[row[-1]][0]] in shown for row in changed
        )
        if is_seen and present.published_at is not None:
            boards.changed(present.split_id)
    return True
