"""Whether the recordings of one day are alike in an edition, for maintainers; the ratios tell no label."""

from collections.abc import Iterator
from typing import Final

from evaluator.scoring.dependence import Dependence, dependence
from evaluator.units import DAY, GIVEN, RECORDING, Units
from leaderboard.errors.refusals import Refused
from leaderboard.models import Edition, Method
from leaderboard.statistics import confidence, recording_sums
from leaderboard.storage import truth_values

N_FIRST: Final = 20


def groups_of(edition: Edition) -> Units:
    """Return the edition's own units, else the days of its recordings.

    Raises `Refused` where there is nothing above the recording, `OSError` without the values.
    """
    manifest = truth_values.load(edition.ground_truth_id).manifest
    kind = edition.unit if edition.unit != RECORDING else GIVEN if manifest.unit else DAY
    try:
        return manifest.units_by(kind)
    except ValueError as fault:
        raise Refused("edition-refused", f"{edition} has nothing to check. {fault}") from None


def checks(edition: Edition, groups: Units) -> Iterator[tuple[str, Dependence | None]]:
    """Check the ranking score of the first methods, best first, and their differences from the best.

    Raises what `recording_sums.sums_of` raises.
    """
    counts = recording_sums.counts_of(edition)[:, 0]
    entries = sorted(confidence.ranked(confidence.active_entries(edition)), key=lambda each: each.value)
    names = dict(Method.objects.filter(pk__in=[each.method_id for each in entries]).values_list("pk", "name"))
    best = None
    for entry in entries[:N_FIRST]:
        sums, name = recording_sums.sums_of(edition, file=entry.file)[:, 0], names[entry.method_id]
        rng = confidence.generator_of(edition, purpose="units")
        yield name, dependence(sums, counts, groups, rng=rng)
        if best is None:
            best = sums, name
        else:
            yield f"{name} − {best[1]}", dependence(sums - best[0], counts, groups, rng=rng)
