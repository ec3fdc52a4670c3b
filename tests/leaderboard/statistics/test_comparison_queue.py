"""Which comparison is computed next, and how many one reader can have computed."""

import itertools
from datetime import timedelta
from typing import Any

import pytest
from django.contrib.auth.models import AnonymousUser
from django.test import Client
from django.utils import timezone
from pytest_django import Settings

from leaderboard.models import Comparison, Edition, Fault, Score, Submission, User
from leaderboard.ops import faults, rate_limits
from leaderboard.statistics import comparison_queue, comparisons, recording_sums
from leaderboard.statistics.comparison_queue import TooManyComparisons
from leaderboard.storage import files, truth_values
from leaderboard.upkeep import backlog
from tests import builders
from tests.leaderboard.web.maintain import queue_rows

pytestmark = [pytest.mark.usefixtures("open_values")]
Pairs = list[tuple[Any, Any]]
ANYBODY = AnonymousUser()


@pytest.fixture(autouse=True)
def nobody_has_asked() -> None:
    rate_limits.IN_PROCESS.clear()


@pytest.fixture
def pairs(edition: Edition, owner: User) -> Pairs:
    """All 28 pairs of 8 evaluations."""
    made = [queue_rows.queued(edition, owner).pk for _ in range(8)]
    return list(itertools.combinations(sorted(made), 2))


def ask(
    edition: Edition,
    *pairs: tuple[Any, Any],
    user: User | AnonymousUser = ANYBODY,
    address: str = "192.0.2.1",
    ago_s: float = 0,
) -> bool:
    """Say if they are computed."""
    now = timezone.now() - timedelta(seconds=ago_s)
    try:
        comparison_queue.ask(edition=edition, pairs=pairs, user=user, address=address, now=now)
    except TooManyComparisons:
        return False
    return True


def upcoming() -> tuple[Any, Any]:
    """The pair whose turn it is, which has had it with that."""
    row = comparison_queue.waiting(readable_truths=truth_values.readable_digests())[0]
    comparison_queue.begin(row, now=timezone.now())
    Comparison.objects.filter(pk=row.pk).update(computed_at=timezone.now(), differences={})
    return row.first_id, row.second_id


def test_the_first_that_was_asked_for_is_computed_first(edition: Edition, pairs: Pairs) -> None:
    for number, pair in enumerate(reversed(pairs[:5])):
        ask(edition, pair, ago_s=9 - number)
    assert [upcoming() for _ in range(5)] == list(reversed(pairs[:5]))


def test_what_nobody_waits_for_comes_last_until_a_reader_does(edition: Edition, pairs: Pairs) -> None:
    comparison_queue.add(edition=edition, pairs=pairs[:3])
    ask(edition, pairs[10])
    ask(edition, pairs[2])
    assert [upcoming() for _ in range(4)] == [pairs[10], pairs[2], pairs[0], pairs[1]]
    assert Comparison.objects.count() == 4


def fail_next(n: int = 1) -> list[tuple[Any, Any]]:
    """The pairs that a worker begins next, and cannot compute."""
    failed = []
    for _ in range(n):
        row = comparison_queue.waiting(readable_truths=truth_values.readable_digests())[0]
        comparison_queue.begin(row, now=timezone.now())
        failed.append((row.first_id, row.second_id))
    return failed


@pytest.mark.parametrize("is_first_asked_for", [True, False])
@pytest.mark.parametrize("is_second_asked_for", [True, False])
def test_a_pair_that_cannot_be_computed_keeps_no_other_waiting(
    edition: Edition, pairs: Pairs, is_first_asked_for: bool, is_second_asked_for: bool
) -> None:
    for pair, is_asked_for in ((pairs[0], is_first_asked_for), (pairs[1], is_second_asked_for)):
        comparison_queue.add(edition=edition, pairs=[pair])
        if is_asked_for:
            ask(edition, pair)
    [failed] = fail_next()
    assert upcoming() == next(pair for pair in pairs[:2] if pair != failed)
    assert upcoming() == failed, "it is tried again when nothing else waits"


def test_what_failed_is_tried_again_in_turn_behind_all_else(edition: Edition, pairs: Pairs) -> None:
    comparison_queue.add(edition=edition, pairs=pairs[:3])
    assert fail_next(4) == [*pairs[:3], pairs[0]]
    comparison_queue.add(edition=edition, pairs=[pairs[9]])
    ask(edition, pairs[2])
    assert [upcoming() for _ in range(4)] == [pairs[9], pairs[1], pairs[2], pairs[0]]


@pytest.mark.slow
def test_fifty_pairs_that_fail_leave_a_turn_to_the_others(
    edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(backlog, "MAX_AT_ONCE", 5)
    sound = [
        builders.submit(owner, builders.predictions(edition, factor=f), method=f"S{f}") for f in (1.1, 1.2)
    ]
    lost = [
        builders.submit(owner, builders.predictions(edition, factor=f), method=f"L{f}")
        for f in (1.3, 1.4, 1.5)
    ]
    builders.score_all()
    builders.infer_all()
    for entry in lost:
        files.store().delete(files.predictions_name(entry.digest))
        recording_sums.path(edition, file=entry.sent_file).unlink()
        manifest = edition.ground_truth.manifest_digest
        files.store().delete(files.aligned_name(manifest_digest=manifest, digest=entry.digest))
    rows = {each: each.evaluations.get().pk for each in (*lost, *sound)}
    failing = [tuple(sorted((rows[one], rows[two]))) for one in lost for two in (*lost, *sound) if one != two]
    comparison_queue.add(edition=edition, pairs=sorted(set(failing)))
    one, two = sorted(rows[each] for each in sound)
    comparison_queue.add(edition=edition, pairs=[(one, two)])
    for _ in range(3):
        builders.infer_all()
    computed = Comparison.objects.exclude(computed_at=None)
    assert [{row.first_id, row.second_id} for row in computed] == [{rows[each] for each in sound}]


def test_one_reader_has_a_number_of_new_ones_computed_and_others_theirs(
    edition: Edition, pairs: Pairs, settings: Settings, owner: User
) -> None:
    settings.PAGE_RATES = settings.PAGE_RATES | {"compare": "3/hour"}
    assert [ask(edition, pair) for pair in pairs[:4]] == [True, True, True, False]
    assert not Comparison.objects.filter(first=pairs[3][0], second=pairs[3][1]).exists()
    assert ask(edition, pairs[3], address="192.0.2.2")
    assert [ask(edition, pair, user=owner, address=pair[0]) for pair in pairs[4:8]] == [True] * 3 + [False]


@pytest.mark.slow
def test_asking_again_counts_nothing(
    entries: list[Submission], edition: Edition, client: Client, settings: Settings
) -> None:
    settings.PAGE_RATES = settings.PAGE_RATES | {"compare": "1/hour"}
    m = "&m=".join(str(entry.method_id) for entry in entries[:2])
    answers = [client.get(f"/api/v1/compare?split=test&m={m}").status_code for _ in range(3)]
    assert answers == [202] * 3
    builders.infer_all()
    assert client.get(f"/api/v1/compare?split=test&m={m}").status_code == 200


def test_who_has_asked_for_too_many_reads_so_on_the_page_and_in_the_api(
    entries: list[Submission], edition: Edition, client: Client, settings: Settings
) -> None:
    settings.PAGE_RATES = settings.PAGE_RATES | {"compare": "1/hour"}
    one, two, three = (str(entry.method_id) for entry in entries[:3])
    assert client.get(f"/compare/?split=test&m={one}&m={two}").status_code == 200
    for address in ("/compare/", "/api/v1/compare"):
        answer = client.get(f"{address}?split=test&m={one}&m={three}")
        assert answer.status_code == 429
        assert 1 <= int(answer["Retry-After"]) <= 3600
        assert "You have asked for many new comparisons in a short time" in answer.content.decode()
    assert answer.json()["code"] == "throttled"
    assert Comparison.objects.count() == 1


def test_a_bug_in_one_job_leaves_their_turn_to_all_others_and_is_noted(
    entries: list[Submission], edition: Edition, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("a bug")

    monkeypatch.setattr(comparisons, "compute", fail)
    one, two = sorted(entry.evaluations.get().pk for entry in entries[:2])
    comparison_queue.add(edition=edition, pairs=[(one, two)])
    builders.infer_all()
    fault = Fault.objects.get(kind=faults.COMPARISONS)
    assert (fault.subject, fault.reason) == (str(edition), "RuntimeError: a bug")
    assert Score.objects.exclude(low=None).exists()
