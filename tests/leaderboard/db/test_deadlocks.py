"""No two verbs wait for each other for ever: locks have one order, and pairs that once did so meet."""

import uuid
from collections.abc import Callable
from datetime import timedelta
from functools import partial
from pathlib import Path

import pytest
from allauth.account.models import EmailAddress
from django.db import connection, transaction
from django.utils import timezone

from leaderboard.editions import ground_truth
from leaderboard.methods import visibility
from leaderboard.models import Edition, Fault, Submission, User
from leaderboard.moderation import forgetting
from leaderboard.ops import faults
from leaderboard.people import invitations, teams, tokens
from leaderboard.queue import lifecycle
from leaderboard.statistics import confidence
from leaderboard.submissions import intake
from tests import builders
from tests.editions import corrected, open_edition, publish
from tests.interlocking import Hold, meet
from tests.leaderboard.web.maintain import queue_rows
from tests.services import ON_POSTGRESQL, crowd_on_postgres

pytestmark = [pytest.mark.slow, *ON_POSTGRESQL]

Action = Callable[[], object]
BOARD, EVENT = "SET CONSTRAINTS ALL IMMEDIATE", 'INSERT INTO "leaderboard_auditevent"'
ORDER = (
    "pg_advisory_xact_lock_shared",  # the bytes of a file
    "leaderboard_split",
    "leaderboard_user",
    "leaderboard_team",
    "leaderboard_invitation",
    "leaderboard_method",
    "leaderboard_submission",
    "leaderboard_evaluation",
    "leaderboard_edition",
    BOARD,
)
"""The locks of a transaction, from first to last; `docs/architecture.md` lists them as well."""


@pytest.fixture
def verbs(entries: list[Submission], edition: Edition, maintainer: User, tmp_path: Path) -> dict[str, Action]:
    """Verbs that take locks, each ready to be done once."""
    now, owner = timezone.now(), entries[0].submitted_by
    assert owner is not None
    team, split = teams.team_of(user=owner), edition.split_id
    # The newcomer is another account of the loner's mailbox.
    loner, newcomer = (User.objects.create_user(f"loner{each}@example.org") for each in ("", "+2"))
    alone = teams.create(user=loner, name="Alone", now=now)
    secret = invitations.make(team=team, actor=owner, now=now)[1]
    private = builders.send(owner, b"{}", method="Private").submission.method
    prepared = open_edition(corrected(tmp_path, factor=1.3))
    lifecycle.claim(lease_s=60, wall_s=300, limit=9)
    leases = [
        lifecycle.Lease(row.pk, row.attempt, row.lease_token)
        for row in prepared.evaluations.order_by("pk")
        if row.lease_token
    ]
    entries_now = confidence.Entries.of(Edition.objects.select_related("ground_truth").get(pk=edition.pk))
    address = EmailAddress.objects.create(user=owner, email="other@example.org", verified=True)
    truth, other = (corrected(tmp_path, factor=factor) for factor in (1.4, 1.5))

    def change_address() -> None:
        with transaction.atomic():
            address.set_as_primary()

    def send(user: User, **fields: str) -> Action:
        return partial(builders.send, user, uuid.uuid4().bytes, method="M1.05", **fields)

    return {
        "submit": send(owner, description="What it is."),
        "submit for the first time": send(newcomer),
        "withdraw": partial(intake.withdraw, submission=entries[0], actor=owner, now=now),
        "finalise": lambda: lifecycle.finalise_many([(lease, queue_rows.SCORED) for lease in leases]),
        "infer": partial(confidence.infer, entries_now, now=now + timedelta(hours=1)),
        "import a ground truth": partial(ground_truth.add, split_name=split, path=truth, now=now, actor=None),
        "open an edition": partial(open_edition, other),
        "publish": partial(publish, prepared, leave_out=True),
        "override a quota": partial(builders.override, team),
        "override a loner's quota": partial(builders.override, alone),
        "make a token": partial(tokens.create, user=owner, name="CI", now=now, split_name=split),
        "change an address": change_address,
        "rename the team": partial(teams.rename, team=team, name="Eagle Owls", actor=owner, now=now),
        "join": partial(invitations.accept, secret=secret, user=loner, now=now),
        "leave alone": partial(teams.leave, user=loner),
        "show a method": partial(
            visibility.change, method=private, visibility="PUBLIC", actor=owner, now=now
        ),
        "forget": partial(forgetting.forget, user=owner, reason="Asked for.", actor=maintainer, now=now),
    }


@pytest.mark.parametrize(
    ("first", "second"),
    [
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
        ("finalise", "publish"),
        ("submit", "forget"),
        ("withdraw", "show a method"),
        ("join", "submit for the first time"),
    ],
)
def test_what_once_waited_for_each_other_for_ever_does_not(
    verbs: dict[str, Action], first: str, second: str
) -> None:
    """The first ten had: one had the lock of all boards and wanted a row, the other the row and wanted it."""
    last = BOARD if first in {"submit", "finalise", "withdraw"} else EVENT
    with crowd_on_postgres():
        outcome = meet(verbs[first], verbs[second], at=lambda number, sql: last in sql)
    assert outcome.was_paused
    assert outcome.faults == (None, None)


def test_two_sweeps_that_count_strikes_of_both_kinds_do_not_wait_for_each_other_for_ever(
    edition: Edition, owner: User
) -> None:
    """Each kind of strike has one counter, and a sweep may count both kinds."""
    for strike in lifecycle.Strike:
        faults.note(faults.STRIKES, subject=strike.value.lower(), reason="", now=timezone.now())
    for _ in range(4):
        queue_rows.queued(edition, owner)
    leases = [queue_rows.claim() for _ in range(4)]

    def sweep(poison_first: bool, held: list[lifecycle.Lease]) -> None:
        queue_rows.expire(held[0], overran=poison_first)
        queue_rows.expire(held[1], overran=not poison_first)
        queue_rows.release_expired()

    with crowd_on_postgres():
        outcome = meet(
            partial(sweep, True, leases[:2]),
            partial(sweep, False, leases[2:]),
            at=lambda number, sql: sql.startswith('UPDATE "leaderboard_fault"'),
        )
    assert outcome == ((None, None), True, True)
    assert [row.n_ever for row in Fault.objects.filter(kind=faults.STRIKES)] == [3, 3]


def test_an_open_transaction_that_has_recorded_keeps_no_other_waiting(verbs: dict[str, Action]) -> None:
    outcome = meet(
        verbs["make a token"], verbs["submit for the first time"], at=lambda number, sql: EVENT in sql
    )
    assert outcome == ((None, None), True, False)


def test_locks_are_taken_in_one_order(verbs: dict[str, Action]) -> None:
    """Of all verbs but those that end what others need."""
    n_taken = 0
    for name in [name for name in verbs if name not in {"forget", "leave alone"}]:
        hold = Hold(lambda number, sql: False)
        with connection.execute_wrapper(hold):
            verbs[name]()
        locking = [sql for sql in hold.statements if "FOR " in sql or "SET CONS" in sql or "pg_adv" in sql]
        taken = [rank for sql in locking for rank, what in enumerate(ORDER) if what in sql.split("WHERE")[0]]
        assert taken == sorted(taken), name
        n_taken += len(taken)
    assert n_taken > 20
