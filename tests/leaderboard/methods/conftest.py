"""A private method that has much to hide."""

import pytest

from leaderboard.models import Edition, Method, Submission, User
from tests import builders


@pytest.fixture
def sent(edition: Edition, owner: User) -> Submission:
    """A scored submission of a private method that is better than everything printed."""
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


@pytest.fixture
def method(sent: Submission) -> Method:
    """Its method."""
    return Method.objects.get(pk=sent.method_id)
