"""A scored submission in short: its rank, how sure its errors are, and the little while it takes to know."""

from __future__ import annotations

import json
from typing import Any

import pytest

from evaluator.client.api import Client
from tests.evaluator.cli.recorded_site import RecordedSite, Reply
from tests.evaluator.cli.test_submissions import GET, ID, POST, QUEUED, SCORED, submit
from tests.evaluator.fake_time import FakeTime
from tests.evaluator.worlds import Tsttc

INTERVAL = {"low": 9.6, "high": 10.905, "rank_low": 1, "rank_high": 3, "is_with_best": True}
AWAITED = SCORED | {"intervals": {}, "awaits_intervals": True, "rank": 2, "visibility": "PUBLIC"}
SURE = AWAITED | {"awaits_intervals": False, "intervals": {"mid": INTERVAL, "rte": INTERVAL}}
MISSING = {"rank_low": None, "rank_high": None, "is_with_best": None}

pytestmark = pytest.mark.usefixtures("at_site")


def lines_above(tsttc: Tsttc, site: RecordedSite, document: dict[str, Any]) -> list[str]:
    """The lines between the state and the table."""
    site.put(GET, Reply(document))
    result = tsttc("status", ID)
    assert (result.exit_code, result.stderr) == (0, "")
    lines = result.stdout.splitlines()
    return lines[1 : lines.index("")]


def test_rank_and_errors_come_with_where_they_may_lie(tsttc: Tsttc, site: RecordedSite) -> None:
    assert lines_above(tsttc, site, SURE) == [
        "rank 2 (1–3)",
        "MiD 10.25 (9.60–10.90), RTE 15.25 (9.60–10.90), in brackets the 95% confidence intervals",
    ]


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        ({"intervals": {}}, ["rank 2"]),
        ({"rank": None, "intervals": {}}, []),
        ({"intervals": {"mid": INTERVAL | {"rank_low": 2, "rank_high": 2}}}, ["rank 2 (2)"]),
        (
            {"visibility": "PRIVATE", "intervals": {"mid": INTERVAL | MISSING}},
            ["if published: rank 2"],
        ),
        ({"rank": None, "intervals": {"mid": INTERVAL | {"low": None}}}, []),
    ],
)
def test_what_is_not_known_is_left_out(
    tsttc: Tsttc, site: RecordedSite, more: dict[str, Any], expected: list[str]
) -> None:
    assert [line for line in lines_above(tsttc, site, SURE | more) if "rank" in line] == expected


def test_server_that_tells_neither_is_no_fault(tsttc: Tsttc, site: RecordedSite) -> None:
    assert lines_above(tsttc, site, SCORED) == []


def test_status_says_that_intervals_are_computed_and_does_not_wait(tsttc: Tsttc, site: RecordedSite) -> None:
    assert lines_above(tsttc, site, AWAITED) == ["rank 2", "The confidence intervals are being computed."]
    assert len(site.requests) == 1


@pytest.mark.slow
def test_wait_and_watch_end_with_the_intervals(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(QUEUED, status=201))
    site.put(GET, Reply(AWAITED), Reply(AWAITED), Reply(SURE))
    assert "rank 2 (1–3)" in submit(tsttc, "--wait").stdout
    site.put(GET, Reply(AWAITED), Reply(SURE))
    assert json.loads(tsttc("status", ID, "--watch", "--json").stdout) == SURE


@pytest.mark.slow
def test_intervals_are_waited_for_only_so_long(client: Client, site: RecordedSite, clock: FakeTime) -> None:
    site.put(GET, Reply(AWAITED), Reply(status=503), Reply(AWAITED))
    *_, last = client.watch(ID, timeout_s=900)
    assert (last.is_final, last.awaits_intervals) == (True, True)
    assert 5 < clock.now_s <= 10
    assert len(site.requests) < 12
