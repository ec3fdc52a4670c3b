"""Confidence intervals and rank ranges of an edition (`docs/uncertainty.md`).

An interval belongs to one evaluation and stays; rank ranges belong to all entries of a board and are computed
again when those change, which a digest tells.
"""

import hashlib
import itertools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cached_property, lru_cache
from typing import NamedTuple
from uuid import UUID

import numpy as np
import structlog
from django.db import transaction
from django.db.models import Exists, OuterRef, Q
from django.db.models.functions import Now
from numpy.typing import NDArray

from evaluator import rounded
from evaluator.metrics.protocol import OVERALL, score_name
from evaluator.scoring import uncertainty
from evaluator.scoring.ranges import Quoted, rank_ranges
from evaluator.scoring.significance import MIN_DEGREES, MIN_DIFFERENT, cut_off, too_few_units
from leaderboard import board_versions
from leaderboard.boards.rows import printed_decimals
from leaderboard.db import clock
from leaderboard.models import (
    Comparison,
    Edition,
    EditionRanges,
    Evaluation,
    PublishedResult,
    Score,
    SentFile,
    Status,
    Visibility,
)
from leaderboard.statistics import disclosure, recording_sums
from leaderboard.storage.seeds import seed_of

log = structlog.get_logger(__name__)

Floats = NDArray[np.float64]
# While an edition is being scored its entries change all the time; its ranges follow once a minute.
MAX_DELAY = timedelta(minutes=1)
# After so many unreadable files a round ends: the store may be away, and each file takes its time.
MAX_UNREADABLE = 5
# A worker that dies while it computes leaves the work to others after this time.
CLAIM_S = 300.0
# Raise it when ranges, intervals or comparisons are computed in another way: workers then compute ranges and
# comparisons again, and drop intervals that there are none of any more. Other intervals stay as published.
_METHOD = 3
_OF_METHOD = f"{_METHOD}:"
# By the evaluation's id, of every column both ends, or None where there is no range.
Ranges = dict[str, list[list[int] | None]]


class ScoredEntry(NamedTuple):
    """A scored, active submission in an edition."""

    evaluation_id: UUID
    file: SentFile
    method_id: UUID
    is_shown: bool
    value: float  # the score that ranks, as published
    submitted_at: datetime


def generator_of(edition: Edition, *, purpose: str) -> np.random.Generator:
    """Return an edition's generator for one purpose. Raises `OSError` without a hidden split's secret."""
    return uncertainty.generator_of(seed_of(edition), purpose=purpose)


# --- which entries ---------------------------------------------------------------------------------------


def active_entries(edition: Edition) -> list[ScoredEntry]:
    """Return the scored, active entries of an edition, private methods included."""
    rows = Score.objects.filter(
        evaluation__edition=edition,
        evaluation__status=Status.SCORED,
        evaluation__submission__withdrawn_at=None,
        metric=edition.rules.primary.name,
        ttc_range=OVERALL,
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
        ScoredEntry(pk, SentFile(digest, manifest), method, visibility != Visibility.PRIVATE, value, at)
        for pk, digest, manifest, method, visibility, value, at in rows
    ]


def ranked(rows: Sequence[ScoredEntry]) -> list[ScoredEntry]:
    """Return the public entries: the best of each shown method, the earlier of two equal ones."""
    best: dict[UUID, ScoredEntry] = {}
    for row in sorted(rows, key=lambda row: (row.value, row.submitted_at)):
        if row.is_shown:
            best.setdefault(row.method_id, row)
    return list(best.values())


def _printed(edition: Edition) -> list[tuple[float, ...]]:
    rows = PublishedResult.objects.on_board(edition.split, edition).values_list("scores", flat=True)
    names = edition.rules.score_names
    return [tuple(float(scores.get(name) or "nan") for name in names) for scores in rows]


@dataclass(frozen=True)
class Entries:
    """The entries of an edition, read once."""

    edition: Edition
    rows: tuple[ScoredEntry, ...]
    printed: tuple[tuple[float, ...], ...]

    @classmethod
    def of(cls, edition: Edition) -> "Entries":
        return cls(edition, tuple(active_entries(edition)), tuple(_printed(edition)))

    @cached_property
    def ranked(self) -> list[ScoredEntry]:
        return ranked(self.rows)

    @cached_property
    def digest(self) -> str:
        """Return the digest of the inputs of inference; private entries count, so never show it."""
        rivals = {row.evaluation_id for row in self.ranked}
        return self._digest([f"{row.evaluation_id} {row.evaluation_id in rivals}" for row in self.rows])

    @cached_property
    def ranked_digest(self) -> str:
        """Return the digest of the inputs of ranges, public entries only."""
        return self._digest([str(row.evaluation_id) for row in self.ranked])

    def _digest(self, lines: Sequence[str]) -> str:
        printed = sorted(map(repr, self.printed))
        head = [self.edition.ground_truth_id, self.edition.protocol]
        text = "\n".join([*head, *printed, *sorted(lines)])
        return f"{_OF_METHOD}sha256:{hashlib.sha256(text.encode()).hexdigest()}"

    @property
    def are_of_earlier_method(self) -> bool:
        """Tell whether what is kept of the edition may have been computed in another way."""
        digest = self.edition.inference_digest
        return bool(digest) and not digest.startswith(_OF_METHOD)

    @property
    def have_ranges(self) -> bool:
        """Tell whether the edition has floor and ranges of these entries."""
        return self.edition.floor is not None and self.edition.inference_digest == self.digest


def stale(*, now: datetime, readable_truths: Collection[str]) -> Iterator[Entries]:
    """Yield the entries of editions whose ranges are out of date, one edition at a time.

    `readable_truths` are digests. An edition with evaluations still to score waits for `MAX_DELAY`.
    """
    undecided = Evaluation.objects.filter(edition=OuterRef("pk"), status__in=[Status.QUEUED, Status.RUNNING])
    editions = (
        Edition.objects.filter(discarded_at=None, ground_truth__in=readable_truths)
        .select_related("ground_truth", "split")
        .annotate(is_busy=Exists(undecided))
        .order_by("pk")
    )
    for edition in editions:
        if edition.is_busy and now - (edition.inferred_at or edition.opened_at) < MAX_DELAY:
            continue
        entries = Entries.of(edition)
        if not entries.have_ranges:
            yield entries


# --- a worker's work -------------------------------------------------------------------------------------


def infer(entries: Entries, *, now: datetime, between: Callable[[], None] = lambda: None) -> bool:
    """Compute missing intervals and, for changed entries, rank ranges. Returns whether anything was written.

    `between` is called every fraction of a second. An entry whose file cannot be read keeps no other's
    interval waiting; rank ranges count every entry, and wait for it. Raises `recording_sums.FAULTS`.
    """
    if entries.have_ranges or not _claim(entries.edition):
        return False
    try:
        intervals, faults = _intervals(entries, between=between)
        if faults:
            _write_intervals(entries, intervals)
            raise faults[0]
        ranges = _ranges(entries, between=between)
        is_written = _write(entries, intervals=intervals, ranges=ranges, now=now)
    finally:
        EditionRanges.objects.filter(edition=entries.edition).update(claimed_until=None)
    log.info("inferred", edition=str(entries.edition), n_entries=len(entries.rows), is_written=is_written)
    return is_written


def _claim(edition: Edition) -> bool:
    # Of a thousand entries the computation takes a processor for minutes.
    row, _ = EditionRanges.objects.get_or_create(edition=edition)
    is_free = Q(claimed_until=None) | Q(claimed_until__lte=Now())
    ends = clock.after(CLAIM_S)
    return bool(EditionRanges.objects.filter(is_free, pk=row.pk).update(claimed_until=ends))


def _intervals(entries: Entries, *, between: Callable[[], None]) -> tuple[list[Score], list[Exception]]:
    """Return the missing intervals, and what kept the files of some entries from being read.

    Intervals of an earlier method that have to go are among them, without ends.
    """
    edition = entries.edition
    usable = uncertainty.usable_columns(recording_sums.unit_counts_of(edition))
    column_of = {name: j for j, name in enumerate(edition.rules.score_names)}
    missing: dict[UUID, list[Score]] = {}
    # In random order: those whose file cannot be read at present keep no other waiting.
    scores = Score.objects.filter(evaluation__edition=edition)
    for score in (scores if entries.are_of_earlier_method else scores.filter(low=None)).order_by("?"):
        if usable[column_of[score_name(score.metric, score.ttc_range)]]:
            missing.setdefault(score.evaluation_id, []).append(score)
    by_id = {row.evaluation_id: row for row in entries.rows}
    rows = [by_id[pk] for pk in missing if pk in by_id]
    made: list[Score] = []
    faults: list[Exception] = []

    def has_new(row: ScoredEntry, sums: Floats) -> bool:
        is_enough = np.count_nonzero(sums, axis=0) >= MIN_DIFFERENT
        return any(
            is_enough[column_of[score_name(each.metric, each.ttc_range)]] == (each.low is None)
            for each in missing[row.evaluation_id]
        )

    readable = (pair for pair in _readable(edition, rows, faults=faults) if has_new(*pair))
    while some := list(itertools.islice(readable, uncertainty.BATCH)):
        between()
        sums = np.stack([own for _, own in some])
        # As they are kept: ranges must not depend on which of them were made before.
        lows, highs = disclosure.published_ends(*bootstrap_of(edition).intervals(sums), edition=edition)
        for i, (row, _) in enumerate(some):
            for score in missing[row.evaluation_id]:
                j = column_of[score_name(score.metric, score.ttc_range)]
                # Where fewer than 6 units have an error there is none.
                if not np.isfinite(lows[i, j]):
                    if score.low is not None:
                        score.low, score.high = None, None
                        made.append(score)
                elif score.low is None:
                    score.low, score.high = (
                        rounded(ends[i, j], decimals=edition.decimals) for ends in (lows, highs)
                    )
                    made.append(score)
    return made, faults


def _readable(
    edition: Edition, rows: Sequence[ScoredEntry], *, faults: list[Exception]
) -> Iterator[tuple[ScoredEntry, Floats]]:
    """Yield entries with their sums, (U, columns); append to `faults` why others have none."""
    for row in rows:
        try:
            sums = recording_sums.unit_sums_of(edition, file=row.file)
        except recording_sums.FAULTS as fault:
            faults.append(fault)
            if len(faults) == MAX_UNREADABLE:
                return
        else:
            yield row, sums


def _ranges(entries: Entries, *, between: Callable[[], None]) -> tuple[str, Ranges] | None:
    edition, rivals, digest = entries.edition, entries.ranked, entries.ranked_digest
    if EditionRanges.objects.filter(edition=edition, digest=digest).exists():
        return None
    counts = recording_sums.unit_counts_of(edition)
    sums = np.empty((len(rivals), *counts.shape))
    for i, row in enumerate(rivals):
        sums[i] = recording_sums.unit_sums_of(edition, file=row.file)
    ranks = rank_ranges(
        sums,
        published=_published_values(edition, [row.evaluation_id for row in rivals]),
        usable=uncertainty.usable_columns(counts),
        rng=generator_of(edition, purpose="signs"),
        quoted=_quoted(entries, counts),
        between=between,
    )
    ends = np.stack([ranks.low, ranks.high], axis=2).tolist()
    return digest, {
        str(row.evaluation_id): [pair if pair[0] else None for pair in columns]
        for row, columns in zip(rivals, ends, strict=True)
    }


def _published_values(edition: Edition, wanted: Sequence[UUID]) -> Floats:
    """Return the values of these evaluations as they are ranked, (n, columns); NaN where one has none."""
    column_of = {name: j for j, name in enumerate(edition.rules.score_names)}
    row_of = {pk: i for i, pk in enumerate(wanted)}
    values = np.full((len(wanted), len(column_of)), np.nan)
    scores = Score.objects.filter(evaluation__edition=edition)
    for pk, metric, ttc_range, value in scores.values_list("evaluation_id", "metric", "ttc_range", "value"):
        if pk in row_of:
            values[row_of[pk], column_of[score_name(metric, ttc_range)]] = value
    return values


def _quoted(entries: Entries, counts: Floats) -> Quoted | None:
    # Before it was rounded, a printed 14.8 was 14.75 to 14.85.
    values = np.array(entries.printed).reshape(-1, len(entries.edition.rules.score_names))
    if not len(values):
        return None
    decimals = [printed_decimals(v for v in row if not np.isnan(v)) for row in values.tolist()]
    half_widths = 0.5 * 10.0 ** -np.array(decimals)[:, None]
    return Quoted(values, np.where(np.isnan(values), np.nan, half_widths), counts)


def bootstrap_of(edition: Edition) -> uncertainty.Bootstrap:
    """Return the weights of the edition's ground truth. Raises `OSError` without access to its values."""
    counts = recording_sums.unit_counts_of(edition)
    return _bootstrap(seed_of(edition), counts.tobytes(), counts.shape)


@lru_cache(maxsize=1)
def _bootstrap(seed: str, counts: bytes, shape: tuple[int, ...]) -> uncertainty.Bootstrap:
    return uncertainty.bootstrap_of(seed, np.frombuffer(counts).reshape(shape))


def _write_intervals(entries: Entries, intervals: list[Score]) -> None:
    if not intervals:
        return
    shown = {row.evaluation_id for row in entries.rows if row.is_shown}
    with transaction.atomic():
        edition = Edition.objects.select_for_update(no_key=True).get(pk=entries.edition.pk)
        Score.objects.bulk_update(intervals, ["low", "high"], batch_size=500)
        if edition.published_at and any(score.evaluation_id in shown for score in intervals):
            board_versions.bump(edition.split_id)


def _write(
    entries: Entries, *, intervals: list[Score], ranges: tuple[str, Ranges] | None, now: datetime
) -> bool:
    """Write intervals and ranges, all or none, if the entries are still the same.

    They are read again with the edition locked: a compare-and-set.
    """
    edition = entries.edition
    shown = {row.evaluation_id for row in entries.rows if row.is_shown}
    floor, degrees = (
        recording_sums.floor_of(edition),
        uncertainty.degrees_of(recording_sums.unit_counts_of(edition)),
    )
    n_effective = dict(zip(edition.rules.score_names, map(cut_off, degrees.tolist()), strict=True))
    with transaction.atomic():
        present = (
            Edition.objects.select_for_update(of=("self",), no_key=True)
            .select_related("ground_truth", "split")
            .get(pk=edition.pk)
        )
        is_first = present.inference_digest == edition.inference_digest
        if not is_first or Entries.of(present).digest != entries.digest:
            return False
        Score.objects.bulk_update(intervals, ["low", "high"], batch_size=500)
        if entries.are_of_earlier_method:
            # They are shown until workers have computed them again.
            Comparison.objects.filter(edition=edition).update(computed_at=None, begun_at=None)
        if ranges is not None:
            digest, of = ranges
            EditionRanges.objects.update_or_create(edition=edition, defaults={"digest": digest, "ranges": of})
        Edition.objects.filter(pk=edition.pk).update(
            inferred_at=now, inference_digest=entries.digest, floor=floor, n_effective=n_effective
        )
        # Whose rows only their own team sees, changes nothing that anybody else is shown.
        is_seen = (
            (floor, n_effective) != (present.floor, present.n_effective)
            or ranges is not None
            or any(score.evaluation_id in shown for score in intervals)
        )
        if is_seen and present.published_at is not None:
            board_versions.bump(present.split_id)
    return True


def why_no_interval(edition: Edition) -> str:
    """Say why nothing in this edition has an interval, a rank range or a p-value; "" where some have.

    A worker saves the effective number of units; until then only too few units in all is known.
    """
    most = max(edition.n_effective.values(), default=float(edition.unit_count))
    if most >= MIN_DEGREES:
        return ""
    return f"There are no confidence intervals: {too_few_units(most, unit=edition.unit)}."
