"""The connection to PostgreSQL is cut at every round trip of every verb: nothing is lost or done twice."""

import itertools
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from django.db import Error, connection

from leaderboard.errors import outages
from leaderboard.models import AuditEvent, Edition, Evaluation, Status, Submission, User
from leaderboard.scoring import lifecycle, worker
from leaderboard.scoring.lifecycle import Lease
from leaderboard.storage import files
from tests import builders
from tests.leaderboard.scoring.cutting_proxy import Cut, CuttingProxy
from tests.leaderboard.web.maintain import queue_rows
from tests.leaderboard.web.maintain.queue_rows import LEASE_S, SCORED, WALL_S

pytestmark = [
    pytest.mark.slow,
    pytest.mark.django_db(transaction=True),
    pytest.mark.skipif(
        connection.vendor != "postgresql",
        reason="SQLite has no connection to cut; `python -m tests.on_postgresql` runs this",
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
    proxy: CuttingProxy, deed: Callable[[], object], *, prepare: Callable[[], object]
) -> Iterator[bool]:
    """Prepare, then do the deed with one cut, for each round trip that it has and each kind of cut.

    Yields, after each, whether the deed came to its end. Whatever it raises must be an outage in the eyes of
    the doors.
    """
    for cut in Cut:
        for at in itertools.count(1):
            prepare()
            with through(proxy):
                proxy.arm(at=at, cut=cut)
                fault: Error | None = None
                try:
                    deed()
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


def test_first_submission_of_a_newcomer_survives_every_cut(proxy: CuttingProxy, edition: Edition) -> None:
    numbers = itertools.count()
    newcomers: list[User] = []
    data = builders.predictions(edition)

    def prepare() -> None:
        number = next(numbers)
        newcomers.append(User.objects.create(email=f"n{number}@example.org", name=f"Newcomer {number}"))

    def send() -> Submission:
        return builders.submit(newcomers[-1], data, visibility="PRIVATE")

    for _ in every_cut(proxy, send, prepare=prepare):
        again = send()
        assert list(Submission.objects.filter(submitted_by=newcomers[-1])) == [again]
        assert list(again.method.team.members.all()) == [newcomers[-1]]


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


VERBS: dict[str, Callable[[Lease], object]] = {
    "claim": lambda _: lifecycle.claim(lease_s=LEASE_S, wall_s=WALL_S),
    "heartbeat": lambda lease: lifecycle.heartbeat(lease, lease_s=LEASE_S),
    "finalise": lambda lease: lifecycle.finalise(lease, SCORED),
    "give back": queue_rows.give_back,
    "hand back": lambda lease: lifecycle.release([lease]),
    "release": lambda _: queue_rows.release_expired(),
}


@pytest.mark.parametrize("name", VERBS)
def test_cut_verb_leaves_a_state_from_which_the_work_goes_on(
    proxy: CuttingProxy, edition: Edition, owner: User, name: str
) -> None:
    leases: list[Lease] = []

    def prepare() -> None:
        evaluation = queue_rows.queued(edition, owner)
        leases[:] = [queue_rows.claim()]
        if name == "claim":
            lifecycle.release(leases)
        if name == "release":
            queue_rows.expire(leases[0])
        assert evaluation.pk == leases[0].evaluation_id

    for _ in every_cut(proxy, lambda: VERBS[name](leases[0]), prepare=prepare):
        row = queue_rows.row(leases[0])
        assert row.n_infrastructure_strikes <= 1
        if row.status == Status.RUNNING:
            Evaluation.objects.filter(pk=row.pk).update(leased_until=row.started_at)
            assert queue_rows.release_expired() == 1
        if row.status != Status.SCORED:
            queue_rows.make_due()
            assert lifecycle.finalise(queue_rows.claim(), SCORED)
        assert queue_rows.n_scores(leases[0]) == len(SCORED.scores)
