"""No two verbs wait for each other for ever: all pairs of them, against each other, on PostgreSQL.

`python -m tests.deadlocks` does it fifty times over, each time held at another statement, and each pair alone
as well.
"""

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import permutations, product
from pathlib import Path

import pytest
from django.db import connection
from django.utils import timezone

from evaluator import read_predictions
from evaluator.metrics.protocol import get_protocol
from evaluator.scoring.scoring import Scorer
from leaderboard.editions import ground_truth
from leaderboard.errors.outages import outage_of
from leaderboard.errors.refusals import Refused
from leaderboard.models import Team, User
from leaderboard.models.submissions import SentFile
from leaderboard.quotas import quotas
from leaderboard.scoring import lifecycle, recording_sums
from leaderboard.storage import truth_values
from tests import builders
from tests.interlocking import Meeting, Outcome, at_the_board_lock, at_the_event
from tests.locking_scene import World, scene
from tests.locking_verbs import VERBS
from tests.services import ON_POSTGRESQL, crowd_on_postgres

N_ROUNDS = int(os.environ.get("TSTTC_DEADLOCK_ROUNDS", "1"))
DEADLOCK_DETECTED = "40P01"
# What a verb may answer to somebody who came second.
ANSWERS = (
    Refused,
    quotas.QuotaExceeded,
    Refused,
    lifecycle.LostRace,
    Team.DoesNotExist,  # it has just ended, which is a 404
)
pytestmark = [pytest.mark.slow, *ON_POSTGRESQL]


@pytest.fixture
def world(benchmark: None, maintainer: User, tmp_path: Path) -> World:
    edition = builders.import_truth(tmp_path, n=40, n_recordings=10)
    path = builders.truth_csv(tmp_path / "corrected.csv", n=40, n_recordings=10, seed=2)
    row = ground_truth.add(split_name="test", path=path, now=timezone.now(), actor=None)
    truth = truth_values.load(edition.ground_truth_id)
    predictions = read_predictions(builders.predictions(edition), manifest=truth.manifest)
    report = Scorer(truth, get_protocol(edition.protocol)).report(predictions, keep_bags=True)
    files = [SentFile(f"sha256:{number:064}", truth.manifest.digest) for number in range(5)]
    for file in files:
        recording_sums.save(edition, file=file, bags=report.bags)
    return World(edition=edition, files=files, correction=row, maintainer=maintainer, folder=tmp_path)


@pytest.fixture
def meeting(world: World) -> Iterator[Meeting]:
    assert connection.vendor == "postgresql"
    with crowd_on_postgres(), Meeting(len(VERBS) // 2) as meeting:
        yield meeting


def meet(world: World, meeting: Meeting, first: str, *others: str, at: int = 0) -> Outcome:
    """One round: the first verb is held at its statement `at`, or where it has all its locks."""
    places = [lambda number, sql: number == at] if at else [at_the_board_lock, at_the_event]
    for place in places:
        there = scene(world)
        deeds = [VERBS[name](there) for name in (first, *others)]
        outcome = meeting.of(*deeds, at=place)
        if outcome.was_held or any(outcome.faults):
            break
    return outcome


MET = [
    ("submit", "infer"),
    ("make a token", "open an edition"),
    ("override a quota", "open an edition"),
    ("override a quota", "import a ground truth"),
    ("override a quota", "rename the team"),
    ("override a loner's quota", "leave alone"),
    ("open an edition", "submit for the first time"),
    ("submit for the first time", "publish"),
    ("submit", "change an address"),
    ("submit for the first time", "override a loner's quota"),
]
"""Pairs of which one had the lock of all and wanted a row, and the other had the row and wanted the lock."""


def test_every_verb_does_its_deed_in_the_scene(world: World) -> None:
    """Else what follows would say nothing of it."""
    failed = {}
    for name, prepare in VERBS.items():
        try:
            prepare(scene(world))()
        except Exception as fault:  # noqa: BLE001 - told below, with all the others
            failed[name] = repr(fault)
    assert failed == {}


def test_whoever_has_recorded_and_not_ended_keeps_nobody_waiting(world: World, meeting: Meeting) -> None:
    for first, second in permutations(("make a token", "submit for the first time")):
        there = scene(world)
        outcome = meeting.of(VERBS[first](there), VERBS[second](there), at=at_the_event)
        assert (outcome.was_held, outcome.n_waited, outcome.faults) == (True, 0, (None, None))


def test_what_once_waited_for_each_other_for_ever_does_not(world: World, meeting: Meeting) -> None:
    faults = {}
    for first, second in MET:
        outcome = meet(world, meeting, first, second)
        assert outcome.was_held, first
        faults[first, second] = outcome.faults
    assert {pair: found for pair, found in faults.items() if found != (None, None)} == {}


def test_no_verbs_wait_for_each_other_for_ever(world: World, meeting: Meeting) -> None:
    """Each is held once where it has all its locks, and meets half of the others: so all pairs meet."""
    found: Counter[str] = Counter()
    n_statements = {}
    for first, others in crowds().items():
        outcome = meet(world, meeting, first, *others)
        n_statements[first] = outcome.n_statements
        count(found, (first, *others), outcome)
    for number in range(1, N_ROUNDS):
        for first, others in crowds(is_backward=number % 2 == 1).items():
            at = number % (n_statements[first] + 1)
            count(found, (first, *others), meet(world, meeting, first, *others, at=at))
    tell(found)


@pytest.mark.skipif(N_ROUNDS == 1, reason="runs with: python -m tests.deadlocks")
def test_no_pair_alone_waits_for_each_other_for_ever(world: World, meeting: Meeting) -> None:
    """Forward and backward."""
    found: Counter[str] = Counter()
    for pair in product(VERBS, repeat=2):
        count(found, pair, meet(world, meeting, *pair))
    tell(found)


def crowds(*, is_backward: bool = False) -> dict[str, list[str]]:
    """For each verb, itself and the half of the others that follow it, or that precede it, in a circle."""
    names, n = list(VERBS)[:: -1 if is_backward else 1], len(VERBS) // 2
    return {name: (2 * names)[i : i + n] for i, name in enumerate(names)}


def count(found: "Counter[str]", names: Sequence[str], outcome: Outcome) -> None:
    """Add what came of one round."""
    found["rounds"] += 1
    found["pairs"] += len(names) - 1
    found["that waited"] += outcome.n_waited
    for name, fault in zip(names, outcome.faults, strict=True):
        if fault is None or isinstance(fault, ANSWERS):
            continue
        outage = outage_of(fault)
        found["deadlocks"] += getattr(fault.__cause__, "sqlstate", None) == DEADLOCK_DETECTED
        found["answers 503"] += outage is not None
        found["other faults"] += outage is None
        found[f"{name}, {names[0]} being held: {fault!r}"[:300]] += 1


def tell(found: "Counter[str]") -> None:
    """Print the figures, which have to be these."""
    print(dict(found))  # noqa: T201 - for whoever runs `python -m tests.deadlocks`
    assert found["that waited"] > found["rounds"] / 2, "else they did not meet"
    assert (found["deadlocks"], found["answers 503"], found["other faults"]) == (0, 0, 0)
