"""What the page of a comparison says of its tests."""

import pytest

from leaderboard.models import Edition
from leaderboard.web.compare.compare_tables import how_tested


@pytest.mark.parametrize(
    ("unit", "noun", "alike"),
    [
        ("day", "days", "recordings from one day"),
        ("given", "units", "recordings from one unit"),
    ],
)
def test_test_names_the_unit_that_it_takes_as_independent(unit: str, noun: str, alike: str) -> None:
    edition = Edition(unit=unit, n_units=40)
    assert how_tested(edition, is_hidden=False) == (
        f"A two-sided sign-flip test of whole {noun} ({edition.units}), because {alike} resemble each other. "
        "It gives the 95% CI and p, and can miss rare but severe failures."
    )


def test_test_of_hidden_ground_truth_says_that_its_ends_are_rounded() -> None:
    edition = Edition(unit="day", n_units=40)
    assert how_tested(edition, is_hidden=True).endswith(
        "so the ends of the intervals are rounded outwards: 0 may be an end although p is below 0.05."
    )
