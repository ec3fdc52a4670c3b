"""The facts at `/docs/`, which come from the protocols of the boards."""

from dataclasses import replace
from pathlib import Path

import pytest
from django.test import Client

from evaluator.metrics.protocol import PROTOCOLS, Protocol, TTCRange
from evaluator.metrics.registry import MID, WARNING
from leaderboard.web.docs import reference
from tests import builders
from tests.pages import get

pytestmark = pytest.mark.slow


def test_a_metric_that_only_another_board_has_is_explained_with_its_board(
    client: Client, tmp_path: Path, benchmark: None
) -> None:
    builders.import_truth(tmp_path)
    builders.import_truth(tmp_path, split="val", seed=1, protocol="tsttc-2")
    text = get(client, "/docs/").one("main").text
    assert "Protocol tsttc-1" in text
    assert "Warning error (WE), in %, only on Validation (protocol tsttc-2)" in text
    assert "its MiD and RTE are those of the dataset’s toolkit" in text


def test_a_metric_is_explained_by_its_unit_the_boards_that_alone_have_it_and_its_meaning() -> None:
    assert reference.metric_words(WARNING, boards=["Val", "Demo"]).startswith(
        ", in %, only on Val and Demo: says whether the prediction misses a warning"
    )
    assert reference.metric_words(MID).endswith("; 0 is perfect")
    unexplained = replace(MID, name="other", unit="")
    assert reference.metric_words(unexplained) == ""


NEAR, FAR = TTCRange("near", 0.0, 3.0), TTCRange("far", 3.0, 20.0)
BELOW = TTCRange("near", 0.0, 3.0, is_high_open=True)


@pytest.mark.parametrize(
    ("protocol", "which", "shared", "near_zero"),
    [
        (
            PROTOCOLS["tsttc-1"],
            ", both ends included",
            "A sequence at exactly 3 s or 6 s counts in two TTC ranges, as in the dataset’s toolkit.",
            "If a file has no prediction between −0.15 and 0.05 s, its MiD and RTE are those of the "
            "dataset’s toolkit.",
        ),
        (
            PROTOCOLS["toolkit"],
            ", both ends included",
            "A sequence at exactly 3 s or 6 s counts in two TTC ranges, as in the dataset’s toolkit.",
            "",
        ),
        (
            Protocol(name="other", limit_s=10.0, near_zero_s=(-0.1, 0.1), ranges=(NEAR, FAR)),
            ", both ends included",
            "A sequence at exactly 3 s counts in two TTC ranges.",
            "",
        ),
        (
            Protocol(name="other", limit_s=10.0, near_zero_s=None, ranges=(BELOW, FAR)),
            "; [ and ] include an end, ( and ) do not",
            "",
            "",
        ),
    ],
)
def test_a_protocol_is_described_by_its_ends_and_by_what_it_shares_with_the_toolkit(
    protocol: Protocol, which: str, shared: str, near_zero: str
) -> None:
    assert reference.range_ends_words(protocol) == which
    assert reference.shared_ends_words(protocol) == shared
    assert reference.near_zero_words(protocol) == near_zero
