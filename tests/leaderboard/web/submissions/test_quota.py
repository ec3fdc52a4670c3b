"""What the submission form says about what is left."""

from datetime import timedelta

import pytest
from django.test import Client
from django.utils import timezone

from leaderboard.models import Edition, Split, Submission, User
from tests import builders, pages
from tests.leaderboard.web.submissions.test_submit import error_at, send


def choice(client: Client, split: str) -> pages.Element:
    root = pages.page(client.get("/submit/"))
    [label] = [each for each in root.all("label", class_="choice") if each.one("strong").text == split]
    return label


def test_the_form_says_what_is_left_on_a_split(signed_in: Client, edition: Edition) -> None:
    Split.objects.filter(pk="test").update(
        quota_limit=3, quota_window=timedelta(days=30), quota_min_gap=timedelta(hours=24)
    )
    said = choice(signed_in, "test").text
    assert "3 of 3 submissions left within 30 days, at least 24 hours apart." in said


def test_the_form_says_when_the_next_slot_opens(signed_in: Client, owner: User, edition: Edition) -> None:
    Split.objects.filter(pk="test").update(quota_limit=1, quota_window=timedelta(days=2))
    builders.submit(owner, builders.predictions(edition))
    opens_at = Submission.objects.get().submitted_at + timedelta(days=2, minutes=1)
    said = choice(signed_in, "test").text
    assert f"the next slot opens at {opens_at:%Y-%m-%d %H:%M} UTC" in said


def test_an_exhausted_quota_stands_at_the_split_in_the_same_words(
    signed_in: Client, owner: User, edition: Edition
) -> None:
    Split.objects.filter(pk="test").update(quota_limit=1)
    builders.submit(owner, builders.predictions(edition))
    response = send(signed_in, builders.predictions(edition, factor=1.2))
    assert error_at(response, "split").startswith("Your team has used 1 submission to test")
    assert Submission.objects.count() == 1


@pytest.mark.parametrize(
    ("column", "days", "said"), [("opens_at", 2, "open at"), ("closes_at", -2, "closed at")]
)
def test_a_split_outside_its_time_cannot_be_chosen_and_says_why(
    signed_in: Client, edition: Edition, column: str, days: int, said: str
) -> None:
    at = timezone.now() + timedelta(days=days)
    Split.objects.filter(pk="test").update(**{column: at})
    root = pages.page(signed_in.get("/submit/"))
    assert "test" not in [each.attributes["value"] for each in root.all("input", type="radio", name="split")]
    [reason] = [
        each.text
        for each in root.one("ul", class_="closed-splits").all("li")
        if each.one("strong").text == "test"
    ]
    assert reason.startswith(f"test: Submissions to test {said} {at:%Y-%m-%d %H:%M} UTC.")
    refused = send(signed_in, builders.predictions(edition))
    assert (refused.status_code, Submission.objects.count()) == (422, 0)
