"""A split whose protocol has neither MiD nor the paper's TTC ranges: nothing that shows it says either."""

import re
from pathlib import Path

import pytest
from django.core.cache import caches
from django.test import Client

from evaluator import Protocol
from evaluator.metrics.protocol import PROTOCOLS, TTCRange
from evaluator.metrics.registry import RTE
from evaluator.tables.formats import FORMATS
from leaderboard.editions import splits
from leaderboard.models import Edition, Method, Split, Submission, User
from tests import builders
from tests.editions import FACTORS
from tests.leaderboard.api.test_submissions import client_of
from tests.security.crawler import crawl

APPROACHING = TTCRange("approaching", 0.0, 5.0, is_low_open=True)
LEAVING = TTCRange("leaving", -20.0, 0.0, is_high_open=True)
OF_OTHERS = Protocol(
    "others-1", limit_s=30.0, near_zero_s=None, ranges=(APPROACHING, LEAVING), metrics=(RTE,)
)
WRONG = re.compile(r"\bMiD\b|(?i:motion-in-depth)|\bmid\b|mid_|crucial|0–3|(?i:ten (?:numbers|scores))|10⁻⁴")
# The paper's own tables, guides about TSTTC, what the API has for all protocols, the wheel, other splits, and
# the form that chooses among all protocols, each with its scores.
ELSEWHERE = re.compile(
    r"^/(maintain/)?published|^/docs/(?!$)|^/dist/.|^/api/v1/(published|schema|docs)|/(val|demo)\b|^/maintain/(audit|test/open)|=(val|demo)\b"
)


@pytest.fixture
def board(
    db: None, owner: User, maintainer: User, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Edition:
    """The test split, open, under the other protocol, with four entries and all that workers make."""
    monkeypatch.setitem(PROTOCOLS, OF_OTHERS.name, OF_OTHERS)
    splits.ensure_splits()
    Split.objects.filter(pk="test").update(is_hidden=False)
    edition = builders.import_truth(tmp_path, protocol=OF_OTHERS.name)
    builders.open_values(edition)
    for factor in FACTORS:
        data = builders.predictions(edition, factor=factor)
        builders.submit(owner, data, method=f"M{factor}", latency_ms="20", hardware="GPU")
    builders.score_all()
    builders.infer_all()
    return edition


@pytest.mark.slow
def test_nothing_that_is_shown_of_a_split_says_what_its_protocol_does_not_have(
    board: Edition, owner: User, maintainer: User
) -> None:
    first, second = Method.objects.order_by("name")[:2]
    sent = Submission.objects.order_by("submitted_at")[0]
    query = f"split=test&m={first.pk}&m={second.pk}"
    start = [
        *("/", "/docs/", "/board/test/", "/board/test/?sort=-rte_leaving&columns=rte", "/board/test/charts/"),
        *("/board/test/editions/", "/board/test/editions/1/", "/feed.atom", "/board/test/feed.atom"),
        *(f"/board/test.{each.suffix}?intervals=1" for each in FORMATS if each.write),
        *("/compare/?split=test", f"/compare/?{query}", f"/methods/{first.pk}/"),
        f"/methods/{first.pk}/badge.svg?split=test",
        *(
            "/api/v1/splits/test/board?intervals=1",
            "/api/v1/splits/test/editions",
            f"/api/v1/compare?{query}",
        ),
        *(f"/api/v1/methods/{first.pk}", f"/api/v1/submissions/{sent.pk}", f"/submissions/{sent.pk}/"),
        *(f"/submissions/{sent.pk}/analysis/", "/submissions/", "/maintain/published/", "/maintain/"),
    ]
    bodies: dict[str, bytes] = {}
    for reader in (None, owner, maintainer):
        client = Client()
        if reader is not None:
            client.force_login(reader)

        def get(path: str, client: Client = client) -> bytes:
            response = client.get(path) if not ELSEWHERE.search(path) else None
            assert response is None or response.status_code < 500, path
            return b"" if response is None or response.status_code >= 400 else response.getvalue()

        bodies |= {f"{reader} {path}": body for path, body in crawl(get, start=start, limit=150).items()}
        builders.infer_all()  # what the pages have asked for
    words = {
        path: WRONG.findall(body.decode())
        for path, body in bodies.items()
        if not body.startswith((b"\x89PNG", b"PK"))
    }
    assert {path: each for path, each in words.items() if each} == {}

    text = {path.removeprefix("None "): body.decode() for path, body in bodies.items()}
    assert "RTE 5.0%" in text[f"/methods/{first.pk}/badge.svg?split=test"]
    assert "Ranked by overall RTE" in text["/board/test/"]
    assert "(0, 5] s" in text["/board/test/"]
    assert "RTE, % (log scale)" in text["/board/test/charts/"]
    assert "Protocol others-1" in text["/docs/"]
    assert "--protocol others-1" in text["/docs/"]
    assert "−30 s or 30 s." in text["/docs/"]


def test_counts_follow_the_protocol_of_the_edition(board: Edition, client: Client) -> None:
    n = board.ground_truth.n_sequences
    counts = board.ground_truth.counts
    assert board.n_out_of_range == n - counts["approaching"] - counts["leaving"] != counts["out_of_range"]
    assert f"{board.n_out_of_range} out of range" in client.get("/board/test/editions/1/").content.decode()
    answer = client_of(User.objects.get(email="owner@example.org")).get("/api/v1/submissions").json()
    assert answer[0]["n_out_of_range"] == board.n_out_of_range


@pytest.mark.slow
def test_another_protocol_changes_no_byte_of_what_there_is(
    entries: list[Submission], owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    builders.infer_all()
    addresses = [
        *("/board/test/editions/1/", "/api/v1/splits/test/editions/1/board?intervals=1"),
        *(f"/board/test/editions/1.{each.suffix}" for each in FORMATS if each.write),
    ]

    def answers() -> list[bytes]:
        for cache in caches.all():
            cache.clear()
        receipt = client_of(owner).get(f"/api/v1/submissions/{entries[0].pk}/receipt").content
        return [receipt, *(Client().get(address).content for address in addresses)]

    before = answers()
    monkeypatch.setitem(PROTOCOLS, OF_OTHERS.name, OF_OTHERS)
    assert answers() == before
