"""Invariants under concurrent requests, each on a connection of its own (SQLite has one writer)."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from pathlib import Path
from threading import Barrier
from typing import TypeVar

import pytest
from allauth.account.models import EmailAddress
from django.db import connection
from pytest_django.fixtures import Settings

from leaderboard import audit
from leaderboard.editions import ground_truth, splits
from leaderboard.errors.refusals import Refused
from leaderboard.methods import visibility
from leaderboard.models import (
    Edition,
    Evaluation,
    GroundTruth,
    Invitation,
    Membership,
    Method,
    PublishedResult,
    Split,
    Submission,
    Team,
    User,
    Visibility,
)
from leaderboard.people import invitations, teams, tokens
from leaderboard.quotas import usage
from leaderboard.storage import hidden_marks
from tests import builders
from tests.leaderboard.quotas.test_mailboxes import account
from tests.leaderboard.web.account import proving
from tests.services import ON_POSTGRESQL, crowd_on_postgres

T = TypeVar("T")
FIRST_DAY = datetime(2026, 11, 1, 12, 0, tzinfo=UTC)
pytestmark = [pytest.mark.slow, *ON_POSTGRESQL]


def at_once(n: int, action: Callable[[int], T]) -> list[T]:
    """Do it `n` times, in threads with connections of their own that are let go at the same time."""
    barrier = Barrier(n, timeout=180)

    def one(number: int) -> T:
        try:
            connection.ensure_connection()
            barrier.wait()
            return action(number)
        finally:
            connection.close()

    with crowd_on_postgres(), ThreadPoolExecutor(n) as pool:
        return list(pool.map(one, range(n)))


def test_twenty_writers_and_four_who_seal_beside_them_keep_one_unbroken_chain() -> None:
    def write(writer: int) -> None:
        for number in range(50):
            if writer < 4:
                audit.seal()
            else:
                audit.record(verb="tried", noun="Door", noun_id=f"{writer}-{number}")

    at_once(24, write)
    audit.seal()
    verification = audit.verify()
    assert (verification.n_events, verification.breaks) == (1000, ())
    assert len(set(audit.events().values_list("noun_id", flat=True))) == 1000


def test_twenty_submissions_at_once_take_exactly_the_five_slots_there_are(
    edition: Edition, owner: User
) -> None:
    Split.objects.filter(pk="test").update(quota_limit=5, quota_window=timedelta(days=1))
    teams.team_of(user=owner)
    data = [builders.predictions(edition, factor=1 + number / 1000) for number in range(20)]

    def submit(number: int) -> bool:
        try:
            return builders.send(owner, data[number]).is_new
        except usage.QuotaExceeded:
            return False

    assert sum(at_once(20, submit)) == 5
    assert Submission.objects.count() == Evaluation.objects.count() == 5


def test_accounts_that_count_together_take_at_once_exactly_the_slots_there_are(
    edition: Edition, settings: Settings
) -> None:
    """One account for each spelling, one with a second proved address, and one that had the mailbox once."""
    Split.objects.filter(pk="test").update(quota_limit=3, quota_window=timedelta(days=30))
    proving.proving(settings)
    people = [account(f"{name}@example.org") for name in ("x", "x+1", "y", "z")]
    for user, name in zip(people, ("z+1", "y+1", "x+2", "x+3"), strict=True):
        EmailAddress.objects.create(user=user, email=f"{name}@example.org", verified=True)
    former = account("former@example.org")
    EmailAddress.objects.create(user=former, email="x+4@example.org", verified=True)
    builders.submit(former, builders.predictions(edition, factor=3), visibility="PRIVATE")
    EmailAddress.objects.filter(email="x+4@example.org").delete()
    data = [builders.predictions(edition, factor=1 + number / 1000) for number in range(24)]

    def submit(number: int) -> bool:
        try:
            return builders.send(people[number % 4], data[number], method=f"M{number}").is_new
        except usage.QuotaExceeded:
            return False

    assert sum(at_once(24, submit)) == 2
    assert Submission.objects.count() == 3


def test_tokens_made_at_once_stay_within_their_number(owner: User) -> None:
    for number in range(tokens.MAX_ACTIVE - 5):
        tokens.create(user=owner, name=f"Old {number}", now=FIRST_DAY)

    def make(number: int) -> bool:
        try:
            tokens.create(user=owner, name=f"CI {number}", now=FIRST_DAY)
        except Refused:
            return False
        return True

    assert sum(at_once(20, make)) == 5


def test_the_same_bytes_at_once_are_one_submission_and_one_slot(edition: Edition, owner: User) -> None:
    Split.objects.filter(pk="test").update(quota_limit=1, quota_window=timedelta(days=1))
    teams.team_of(user=owner)
    data = builders.predictions(edition)
    assert len({submission.pk for submission in at_once(20, lambda _: builders.submit(owner, data))}) == 1
    assert Submission.objects.count() == 1


def test_of_ten_who_follow_one_link_at_once_one_comes_in(owner: User) -> None:
    team = teams.team_of(user=owner)
    people = [User.objects.create_user(f"{i}@example.org", name=f"P {i}") for i in range(10)]
    for person in people[::2]:
        teams.team_of(user=person)
    secret = invitations.make(team=team, actor=owner, now=FIRST_DAY)[1]

    def accept(number: int) -> bool:
        try:
            invitations.accept(secret=secret, user=people[number], now=FIRST_DAY)
        except Refused:
            return False
        return True

    assert sum(at_once(10, accept)) == 1
    assert Membership.objects.filter(team=team, user__in=people).count() == 1


def test_one_person_who_follows_ten_links_at_once_is_in_one_team(owner: User) -> None:
    secrets = []
    for number in range(10):
        host = User.objects.create_user(f"host-{number}@example.org", name=f"Host {number}")
        secrets.append(invitations.make(team=teams.team_of(user=host), actor=host, now=FIRST_DAY)[1])

    def accept(number: int) -> bool:
        try:
            invitations.accept(secret=secrets[number], user=owner, now=FIRST_DAY)
        except Refused:
            return False
        return True

    assert sum(at_once(10, accept)) >= 1
    assert Membership.objects.filter(user=owner).count() == 1
    used = Invitation.objects.exclude(accepted_at=None)
    assert {row.accepted_by_id for row in used} == {owner.pk}


def test_of_teams_that_look_alike_one_alone_is_shown_at_once(db: None) -> None:
    people = [User.objects.create_user(f"{i}@example.org") for i in range(12)]
    methods = [
        Method.objects.create(
            team=teams.create(user=user, name=["Owls", "0wls", "ΟWLS", "owls"][number % 4], now=FIRST_DAY),
            name="Foo",
            created_at=FIRST_DAY,
        )
        for number, user in enumerate(people)
    ]

    def show(number: int) -> bool:
        try:
            visibility.change(
                method=methods[number], visibility=Visibility.PUBLIC, actor=people[number], now=FIRST_DAY
            )
        except Refused:
            return False
        return True

    assert sum(at_once(12, show)) == 1
    assert Team.objects.filter(is_shown=True).count() == 1


def test_of_methods_that_look_alike_one_alone_is_shown_at_once(db: None) -> None:
    people = [User.objects.create_user(f"{i}@example.org") for i in range(8)]
    methods = [
        Method.objects.create(
            team=teams.create(user=user, name=f"Team number {number}", now=FIRST_DAY),
            name=["Owl Net", "0wl-Net", "ΟWL NET.", "(owl net)"][number % 4],
            created_at=FIRST_DAY,
        )
        for number, user in enumerate(people)
    ]

    def show(number: int) -> bool:
        try:
            visibility.change(
                method=methods[number], visibility=Visibility.PUBLIC, actor=people[number], now=FIRST_DAY
            )
        except Refused:
            return False
        return True

    assert sum(at_once(8, show)) == 1
    assert Method.objects.filter(visibility=Visibility.PUBLIC).count() == 1


def test_rows_of_papers_and_methods_that_look_alike_are_not_both_shown_at_once(edition: Edition) -> None:
    people = [User.objects.create_user(f"{i}@example.org") for i in range(8)]
    names = [f"Owl Net {number // 2}" for number in range(8)]
    methods = [
        Method.objects.create(
            team=teams.create(user=user, name=f"Team number {number}", now=FIRST_DAY),
            name=names[number],
            created_at=FIRST_DAY,
        )
        for number, user in enumerate(people)
    ]
    scores = dict.fromkeys(edition.rules.score_names, 1.0)

    def show(number: int) -> bool:
        try:
            if number % 2:
                visibility.change(
                    method=methods[number], visibility=Visibility.PUBLIC, actor=people[number], now=FIRST_DAY
                )
            else:
                about = {"title": "T", "authors": "A", "table": "1", "year": 2024}
                source = {**about, "url": "https://a.example"}
                document = {
                    "source": source,
                    "columns": list(scores),
                    "methods": [{"slug": f"row-{number}", "name": f"({names[number]})"}],
                    "results": {"test": {f"row-{number}": list(scores.values())}},
                }
                splits.import_published(document=document, now=FIRST_DAY)
        except Refused:
            return False
        return True

    assert sum(at_once(8, show)) == 4
    public = Method.objects.filter(visibility=Visibility.PUBLIC).values_list("name", flat=True)
    quoted = PublishedResult.objects.filter(slug__startswith="row-").values_list("method_name", flat=True)
    assert sorted([*public, *(name.strip("()") for name in quoted)]) == names[::2]


def test_of_an_open_and_a_hidden_split_one_alone_gets_the_same_sequences_at_once(
    benchmark: None, tmp_path: Path
) -> None:
    truths = [
        builders.truth_csv(tmp_path / f"{split}.csv", seed=seed)
        for seed, split in enumerate(["val", "demo", "test"])
    ]

    def take(number: int) -> bool:
        try:
            ground_truth.import_truth(
                split_name=truths[number % 3].stem, path=truths[number % 3], now=FIRST_DAY
            )
        except Refused:
            return False
        return True

    at_once(6, take)
    hidden = GroundTruth.objects.filter(split__is_hidden=True).exists()
    opened = GroundTruth.objects.filter(split__is_hidden=False).exists()
    assert (hidden, opened) in {(True, False), (False, True)}
    assert bool(hidden_marks.digests()) == hidden


def test_methods_that_look_alike_at_once_are_one(edition: Edition, owner: User) -> None:
    teams.team_of(user=owner)
    data = [builders.predictions(edition, factor=1 + number / 100) for number in range(12)]

    def submit(number: int) -> bool:
        try:
            builders.submit(owner, data[number], method=["Foo", "F0o", "FOO", "Fοo"][number % 4])
        except Refused:
            return False
        return True

    assert sum(at_once(12, submit)) == 3
    assert Method.objects.count() == 1


def test_leaving_while_sending_gives_nobody_another_slot(edition: Edition, owner: User) -> None:
    Split.objects.filter(pk="test").update(quota_limit=3, quota_window=timedelta(days=1))
    data = [builders.predictions(edition, factor=1 + number / 1000) for number in range(20)]

    def go_on(number: int) -> None:
        try:
            if number % 4 == 3:
                teams.leave(user=owner)
            else:
                builders.submit(owner, data[number], method=f"M{number}")
        except (Refused, usage.QuotaExceeded):
            return

    at_once(20, go_on)
    assert Submission.objects.count() <= 3
    assert audit.verify().breaks == ()
