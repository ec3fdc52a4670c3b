"""A private method that has much to hide."""

import pytest

from leaderboard.models import Edition, Method, Submission, User
from tests import builders, kept
from tests.leaderboard.conftest import make_edition, make_owner


def _send(edition: Edition, owner: User) -> Submission:
    made = builders.submit(
        owner,
        builders.predictions(edition, factor=1.0000001),
        method="Secret sauce",
        visibility="PRIVATE",
        description="Words of its own",
        paper_url="https://example.org/secret-paper",
        code_url="https://example.org/secret-code",
    )
    Method.objects.update(
        n_frames=6, latency_ms=12.5, hardware="Laptop of Ada", pretraining="WebText of Ada", cameras="ONE"
    )
    builders.score_all()
    return made


kept.MAKERS["sent"] = lambda folder: _send(make_edition(folder), make_owner())


@pytest.fixture
def sent(edition: Edition, owner: User) -> Submission:
    """A scored submission of a private method that is better than everything printed."""
    if kept.is_kept("sent"):
        return Submission.objects.select_related("method__team", "split").get()
    return _send(edition, owner)


@pytest.fixture
def method(sent: Submission) -> Method:
    """Its method."""
    return Method.objects.get(pk=sent.method_id)
