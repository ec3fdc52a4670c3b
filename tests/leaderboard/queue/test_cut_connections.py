"""The connection to PostgreSQL is cut at every round trip of every verb: nothing is lost or done twice."""

import itertools
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from django.db import Error, connection

from leaderboard.errors import outages
from leaderboard.models import AuditEvent, Edition, Status, Submission, User
from leaderboard.queue import worker
from leaderboard.queue.lifecycle import Lease
from leaderboard.storage import files
from tests import builders
from tests.leaderboard.queue.cutting_proxy import Cut, CuttingProxy
from tests.leaderboard.web.maintain import queue_rows

pytestmark = [
    pytest.mark.slow,
    pytest.mark.django_db(transaction=True),
    pytest.mark.skipif(
        connection.vendor != "postgresql",
        reason="SQLite has no connection to cut; `python -m tests.everything` runs this",
    ),
]


@pytest.fixture
def proxy() -> Iterator[CuttingProxy]:
    """A proxy before the test's own PostgreSQL."""
    target = connection.settings_dict
    with CuttingProxy(host=target["HOST"] or "127.0.0.1", port=int(target["PORT"] or 5432)) as proxy:
        yield proxy


@contextmanager
def through(proxy: CuttingProxy) -> Iterator[None]:
    """Connect by way of the proxy."""
    direct = {name: connection.settings_dict[name] for name in ("HOST", "PORT", "OPTIONS")}
    connection.close()
    options = {**direct["OPTIONS"], "sslmode": "disable", "gssencmode": "disable"}
    connection.settings_dict |= {"HOST": "127.0.0.1", "PORT": str(proxy.port), "OPTIONS": options}
    try:
        yield
    finally:
        connection.close()
        connection.settings_dict |= direct


def every_cut(
    proxy: CuttingProxy, action: Callable[[], object], *, prepare: Callable[[], object]
) -> Iterator[bool]:
    """Prepare, then do the action with one cut, for each round trip that it has and each kind of cut.

    Yields, after each, whether the action came to its end. Whatever it raises must be an outage in the eyes
    the doors.
    """
    for cut in Cut:
        for at in itertools.count(1):
            prepare()
            with through(proxy):
                proxy.arm(at=at, cut=cut)
                fault: Error | None = None
                try:
                    action()
                except Error as caught:
                    fault = caught
                was_cut = proxy.was_cut
                proxy.disarm()
            came_to_its_end = fault is None
            assert came_to_its_end or outages.outage_of(fault) == outages.DATABASE_AWAY, repr(fault)
            yield came_to_its_end
            if not was_cut:
                assert came_to_its_end
                assert at > 3, "connecting alone takes more round trips than that"
                break


def test_submit_is_never_lost_once_acknowledged_and_never_doubled_when_sent_again(
    proxy: CuttingProxy, edition: Edition, owner: User
) -> None:
    factors = itertools.count(1)
    sending: list[bytes] = []
    acknowledged: list[Submission] = []

    def prepare() -> None:
        acknowledged.clear()
        sending[:] = [builders.predictions(edition, factor=1 + next(factors) / 1000)]

    def submit() -> None:
        acknowledged.append(builders.submit(owner, sending[0]))

    n_cuts = n_known = 0
    for came_to_its_end in every_cut(proxy, submit, prepare=prepare):
        n_known += Submission.objects.count() - n_cuts if not came_to_its_end else 0
        again = builders.submit(owner, sending[0])
        n_cuts += 1
        assert acknowledged in ([], [again])
        assert Submission.objects.count() == n_cuts
        assert again.evaluations.get().status == Status.QUEUED
        assert AuditEvent.objects.filter(verb="submitted", noun_id=again.pk).count() == 1
        with files.opened_predictions(again.digest) as kept:
            assert kept.read() == sending[0]
    assert n_cuts > 10
    assert n_known >= 1, "the answer to COMMIT was lost, and the file was known when it came again"


def test_a_run_is_decided_once_wherever_it_is_cut(
    proxy: CuttingProxy, edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The cut server is back at once, so there is no reason to wait for it.
    monkeypatch.setattr(worker.time, "sleep", lambda seconds: None)
    data = builders.predictions(edition)
    numbers = itertools.count()
    leases: list[Lease] = []

    def prepare() -> None:
        builders.submit(owner, data, method=f"Method {next(numbers)}")
        leases[:] = [queue_rows.claim()]

    n_kept = 0
    for came_to_its_end in every_cut(
        proxy, lambda: worker.run(leases[0], rng=random.Random(0)), prepare=prepare
    ):
        evaluation = queue_rows.row(leases[0])
        if came_to_its_end:
            n_kept += 1
        else:
            assert evaluation.status == Status.RUNNING
            queue_rows.expire(leases[0])
            queue_rows.release_expired()
            queue_rows.make_due()
            assert worker.run_next(rng=random.Random(0))
            evaluation.refresh_from_db()
        assert (evaluation.status, evaluation.attempt) == (Status.SCORED, 1 if came_to_its_end else 2)
        assert evaluation.finished_attempt == evaluation.attempt
        assert evaluation.scores.count() == 10
        assert AuditEvent.objects.filter(noun_id=evaluation.pk, verb="scored").count() == 1
    assert n_kept > 10, "a cut while finalising is survived without a second run"
