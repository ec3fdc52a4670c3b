"""Ranks that moved in a month: counted between two boards of one edition, and told of what everyone sees."""

from datetime import timedelta

import pytest
from django.contrib.auth.models import AnonymousUser
from django.test import Client
from django.utils import timezone

from leaderboard.boards import listing, movement
from leaderboard.models import Edition, Evaluation, Method, Publication, Split, Submission, User
from tests import board_rows, builders, pages
from tests.caching import forget_boards

NEW = "Submitted or published less than 14 days ago"


@pytest.fixture
def months(edition: Edition, owner: User) -> list[Method]:
    """Eight methods: all but two are two months old, as is the edition."""
    methods = board_rows.fill(edition, n=8, user=owner)
    then = timezone.now() - timedelta(days=60)
    old = [method.pk for method in methods[:6]]
    Method.objects.filter(pk__in=old).update(shown_at=then)
    Submission.objects.filter(method__in=old).update(submitted_at=then)
    Evaluation.objects.filter(submission__method__in=old).update(finished_at=then)
    Publication.objects.filter(edition=edition).update(at=then)
    Edition.objects.filter(pk=edition.pk).update(published_at=then)
    builders.board_changed("test")
    return methods


def board_of(*, days_ago: int = 0) -> listing.Board:
    at = timezone.now() - timedelta(days=days_ago) if days_ago else None
    return listing.board(split=Split.objects.get(pk="test"), viewer=AnonymousUser(), at=at)


def test_ranks_have_moved_as_the_two_boards_say(months: list[Method]) -> None:
    then = {entry.method_id: entry.rank for entry in board_of(days_ago=40).entries if entry.method_id}
    now = {entry.method_id: entry.rank for entry in board_of().entries if entry.method_id}
    expected = {pk: rank - (now[pk] or 0) for pk, rank in then.items() if rank}
    assert len(expected) == 6
    assert movement.moved(board_of(), now=timezone.now()) == expected
    assert any(expected.values())


def test_ranks_of_another_edition_and_boards_of_the_past_have_not_moved(months: list[Method]) -> None:
    assert movement.moved(board_of(days_ago=10), now=timezone.now()) == {}
    Edition.objects.update(published_at=timezone.now())
    forget_boards()
    assert movement.moved(board_of(), now=timezone.now()) == {}


@pytest.mark.slow
def test_page_tells_what_is_new_and_what_has_moved(months: list[Method], client: Client) -> None:
    root = pages.get(client)
    new = [
        row for row in root.one("table", class_="board").one("tbody").all("tr") if row.all("span", title=NEW)
    ]
    assert {row.one("div", class_="name").text for row in new} == {each.name for each in months[6:]}
    moved = movement.moved(board_of(), now=timezone.now())
    marks = [each.text for each in root.one("table", class_="board").one("tbody").all("span", class_="moved")]
    assert len(marks) == sum(1 for each in moved.values() if each)
    assert all("in a month" in text for text in marks)
    Submission.objects.update(submitted_at=timezone.now())
    Method.objects.update(shown_at=timezone.now())
    builders.board_changed("test")
    assert pages.get(client).one("table", class_="board").one("tbody").all("span", title=NEW) == [], (
        "of most rows it says nothing"
    )
