"""People for the single claims; the matrices bring their own."""

from pathlib import Path

import pytest
from pytest_django.fixtures import Settings

from leaderboard.models import Edition, User
from tests import builders
from tests.security import people
from tests.security.people import World


@pytest.fixture
def owner(db: None) -> User:
    return User.objects.create_user("owner@example.org", "correct horse", name="Owls")


@pytest.fixture
def edition(benchmark: None, tmp_path: Path) -> Edition:
    """The test split, open, with made-up ground truth."""
    return builders.import_truth(tmp_path)


@pytest.fixture
def world(edition: Edition, settings: Settings, tmp_path: Path) -> World:
    """The seven roles, around one private method."""
    settings.DIST_DIR = tmp_path / "no-wheel"
    settings.ACCOUNT_RATE_LIMITS = False  # one address asks a thousand times
    return people.populate(edition)
