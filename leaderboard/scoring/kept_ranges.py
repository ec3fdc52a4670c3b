"""Rank ranges of an edition, from the pairs that this worker has kept of it.

All pairs of a board are compared, and most of them are those of the last time. So a worker keeps what it made
of them in its own memory, where the turned sums of hidden recordings are nobody else's, and adds and removes
what came and went since. Nobody has to be told of a change: what is kept knows its entries, and what else it
was made of. A worker that has kept nothing, or a board too large to be kept, costs all pairs; the ranges are
the same.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from uuid import UUID

import numpy as np
from django.conf import settings
from numpy.typing import NDArray

from evaluator.metrics.protocol import score_name
from evaluator.scoring import uncertainty
from evaluator.scoring.ranges import KeptRanges, Quoted, RankRanges, rank_ranges
from leaderboard.models import Edition, Score, SentFile
from leaderboard.scoring import recording_sums
from leaderboard.storage.seeds import seed_of

Floats = NDArray[np.float64]
# From so many entries on, the values of all are asked for at once.
MANY = 500


@dataclass(frozen=True)
class _Kept:
    made_of: str
    ranges: KeptRanges


# By edition, the one that was asked for last at the end.
_kept: dict[int, _Kept] = {}


def ranges_of(
    edition: Edition,
    files: Mapping[UUID, SentFile],
    *,
    quoted: Quoted | None,
    between: Callable[[], None] = lambda: None,
) -> RankRanges:
    """The rank ranges of these evaluations, in their order; `quoted` are the rows from papers.

    `between` is called every fraction of a second. Raises what `recording_sums.sums_of` raises.
    """
    counts = recording_sums.unit_counts_of(edition)
    usable = uncertainty.usable_columns(counts)
    signs = uncertainty.generator_of(seed_of(edition), purpose="signs")
    wanted = list(files)
    # Taken out while it is changed: what is left half-way is of no use.
    kept = _kept.pop(edition.pk, None)
    if not is_kept(edition, n_entries=len(wanted)):
        sums, published = _sums(edition, list(files.values()), between), _published(edition, wanted)
        return rank_ranges(
            sums, published=published, usable=usable, rng=signs, quoted=quoted, between=between
        )
    made_of = _made_of(edition, quoted)
    gone = [] if kept is None else [key for key in kept.ranges.keys if key not in files]
    if kept is None or kept.made_of != made_of or len(gone) > len(wanted) // 10 + 1:
        gone = []
        kept = _Kept(
            made_of,
            KeptRanges(
                n_recordings=len(counts), usable=usable, rng=signs, quoted=quoted, n_entries=len(wanted)
            ),
        )
    kept.ranges.remove(gone, between=between)
    new = [pk for pk in wanted if pk not in kept.ranges.keys]
    kept.ranges.add(
        new,
        sums=_sums(edition, [files[pk] for pk in new], between),
        published=_published(edition, new),
        between=between,
    )
    found = kept.ranges.ranges(wanted, between=between)
    _keep(edition.pk, kept)
    return found


def is_kept(edition: Edition, *, n_entries: int) -> bool:
    """Whether the pairs of so many entries are few enough to be kept."""
    shape = edition.unit_count, len(edition.rules.score_names)
    return KeptRanges.nbytes_of(n_entries, n_recordings=shape[0], n_columns=shape[1]) <= _budget()


def forget() -> None:
    """Drop all that is kept."""
    _kept.clear()


def n_bytes() -> int:
    """What all that is kept takes of memory."""
    return sum(each.ranges.nbytes for each in _kept.values())


def _budget() -> float:
    return float(settings.KEPT_PAIRS_MB * 1e6)


def _keep(pk: int, kept: _Kept) -> None:
    _kept[pk] = kept
    while n_bytes() > _budget() and len(_kept) > 1:
        del _kept[next(iter(_kept))]


def _made_of(edition: Edition, quoted: Quoted | None) -> str:
    """Names what does not change while entries come and go: all but them."""
    parts = [seed_of(edition), edition.ground_truth_id, edition.protocol]
    if quoted is not None:
        parts += [quoted.values.tobytes().hex(), quoted.half_widths.tobytes().hex()]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _sums(edition: Edition, files: Sequence[SentFile], between: Callable[[], None]) -> Floats:
    """The sums of these files, (n, U, columns)."""
    shape = edition.unit_count, len(edition.rules.score_names)
    sums = np.empty((len(files), *shape))
    for i, file in enumerate(files):
        if i % MANY == MANY - 1:
            between()
        sums[i] = recording_sums.unit_sums_of(edition, file=file)
    return sums


def _published(edition: Edition, wanted: Sequence[UUID]) -> Floats:
    """The values of these evaluations as they are ranked, (n, columns); NaN where one has none."""
    column_of = {name: j for j, name in enumerate(edition.rules.score_names)}
    row_of = {pk: i for i, pk in enumerate(wanted)}
    values = np.full((len(wanted), len(column_of)), np.nan)
    scores = Score.objects.filter(evaluation__edition=edition)
    if len(wanted) < MANY:
        scores = scores.filter(evaluation__in=wanted)
    for pk, metric, interval, value in scores.values_list("evaluation_id", "metric", "interval", "value"):
        if pk in row_of:
            values[row_of[pk], column_of[score_name(metric, interval)]] = value
    return values
