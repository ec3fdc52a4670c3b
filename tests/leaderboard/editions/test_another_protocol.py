"""A protocol with a further TTC range and a third metric: whatever shows an edition asks its protocol."""

import re
from typing import Any

import msgspec
import numpy as np
import pytest
from django.test import Client
from django.utils import timezone

from evaluator import Protocol, receipts
from evaluator.cli.boards import in_words
from evaluator.cli.layout import result_in_words
from evaluator.client.answers import Board
from evaluator.metrics.protocol import PROTOCOLS, SCORE_NAMES, TTC_RANGES, TTCRange
from evaluator.metrics.registry import MID, RTE, Metric
from evaluator.tables.formats import FORMATS
from leaderboard.api.serializers import CountsSerializer, ScoresSerializer
from leaderboard.methods import visibility
from leaderboard.models import Edition, Score, Submission, User
from tests import builders, pages
from tests.editions import FACTORS, open_edition, publish
from tests.leaderboard.api.test_submissions import client_of, post

ABSOLUTE = Metric(
    "absolute",
    "AE",
    "s",
    "Absolute TTC error",
    2,
    lambda terms: np.abs(terms.predicted_ttc_s - terms.true_ttc_s),
)
FAR = Protocol(
    name="tsttc-far",
    limit_s=60.0,
    near_zero_s=(-0.15, 0.05),
    ranges=(*TTC_RANGES, TTCRange("far", 20.0, 60.0)),
    metrics=(MID, RTE, ABSOLUTE),
)
NEW = [name for name in FAR.score_names if name not in SCORE_NAMES]


@pytest.fixture
def old_receipt(open_board: Edition, entries: list[Submission], owner: User) -> bytes:
    """A receipt from before the protocol is known."""
    return bytes(client_of(owner).get(f"/api/v1/submissions/{entries[0].pk}/receipt").content)


@pytest.fixture
def open_board(open_values: None, edition: Edition) -> Edition:
    """The published edition of an open split, under the first protocol."""
    return edition


@pytest.fixture
def far(old_receipt: bytes, owner: User, monkeypatch: pytest.MonkeyPatch) -> Submission:
    """The board under the new protocol, with a file that was uploaded to it and all that workers make."""
    monkeypatch.setitem(PROTOCOLS, FAR.name, FAR)
    edition = open_edition(protocol=FAR.name)
    builders.score_all()
    publish(edition)
    answer = post(
        client_of(owner), builders.predictions(edition, factor=1.02), method="New one", split="test"
    )
    assert answer.status_code == 201
    builders.score_all()
    submission = Submission.objects.get(method__name="New one")
    visibility.change(method=submission.method, visibility="PUBLIC", actor=owner, now=timezone.now())
    builders.infer_all()
    return submission


def page_text(client: Client, address: str, status: int = 200) -> str:
    response = client.get(address)
    assert response.status_code == status, address
    return pages.page(response).text


def document(client: Any, address: str) -> dict[str, Any]:
    response = client.get(address)
    assert response.status_code == 200, address
    return dict(response.json())


@pytest.mark.slow
def test_a_further_range_and_a_third_metric_stand_wherever_their_edition_is_shown(
    far: Submission, old_receipt: bytes, owner: User, client: Client
) -> None:
    names = list(FAR.score_names)
    assert len(names) == 18

    # Board: page, JSON, order, columns.
    board = document(client, "/api/v1/splits/test/board?intervals=1")
    assert board["protocol"] == FAR.name
    assert all(list(row["scores"]) == names for row in board["entries"])
    assert board["floor"] == dict.fromkeys(names, 0.0)
    scored = [row for row in board["entries"] if row["kind"] == "submission"]
    assert len(scored) == len(FACTORS) + 1
    assert all(value is not None for row in scored for value in row["scores"].values())
    assert all(row["scores"][name] is None for row in board["entries"] if row not in scored for name in NEW)
    page = page_text(client, "/board/test/")
    words = "Absolute TTC error (AE): the table shows only the overall value. Press AE above"
    assert words in page
    assert "20–60 s" in page
    # As many columns as fit on a screen, each with its unit for phones; all where the metric is chosen.
    heads = pages.page(client.get("/board/test/")).one("table", class_="board").all("th", scope="col")
    assert [head.text for head in heads if "AE" in head.text] == ["AEAE, overall, soveralls"]
    assert "Absolute TTC error (AE) s" in page_text(client, "/board/test/?columns=absolute")
    assert "AE" in page_text(client, "/board/test/?sort=-absolute_far&columns=absolute")
    unsorted = page_text(client, "/board/test/editions/1/?sort=absolute", 400)
    assert "This board has no “absolute” column, so it is sorted by rank." in unsorted

    # Comparison and charts.
    ids = [row["method_id"] for row in scored[:2]]
    query = f"split=test&m={ids[0]}&m={ids[1]}"
    page_text(client, f"/compare/?{query}")
    builders.infer_all()
    pair = document(client, f"/api/v1/compare?{query}")["pairs"][0]
    assert list(pair["differences"]) == names
    assert "AE" in pair["differences"]["absolute"]["sentence"]
    assert "20–60 s" in page_text(client, f"/compare/?{query}")
    charts = page_text(client, "/board/test/charts/")
    assert "AE, s" in charts
    assert "far" in charts

    # Exports, and the command's table.
    for each in FORMATS:
        if each.has_values and each.write is not None:
            text = client.get(f"/board/test.{each.suffix}?intervals=1").content.decode()
            assert "far" in text, each.name
            assert "absolute" in text or "AE" in text, each.name
    table = "\n".join(in_words(msgspec.convert({**board, "document": board}, Board), width=None))
    assert "AE_f" in table
    assert "AE s, lower is better; TTC ranges in s: c 0–3, s 3–6, l 6–20, n −20–0, f 20–60" in table

    # Method, submission, analysis, receipt.
    assert "AE s" in page_text(client, f"/methods/{far.method_id}/")
    api = client_of(owner)
    answer = document(api, f"/api/v1/submissions/{far.pk}")
    assert list(answer["scores"]) == names
    assert list(answer["counts"]) == list(FAR.range_names)
    assert "AE_f" in "\n".join(
        result_in_words(answer["scores"], counts=answer["counts"], n_out_of_range=0, truncated={})
    )
    client.force_login(owner)
    assert "MiD, RTE and AE (each overall, crucial" in page_text(client, f"/submissions/{far.pk}/")

    assert "AE" in page_text(client, "/submissions/")
    assert "AE s" in page_text(client, f"/submissions/{far.pk}/analysis/")
    assert "far" in page_text(client, "/board/test/editions/2/")
    receipt = api.get(f"/api/v1/submissions/{far.pk}/receipt").content
    keys = receipts.read_keys(Client().get(receipts.KEYS_PATH).content)
    assert receipts.verify(receipt, keys).scores == answer["scores"]
    assert receipts.verify(receipt, keys).counts == answer["counts"]


def test_what_was_scored_under_the_first_protocol_stays_as_it_is(
    far: Submission, old_receipt: bytes, entries: list[Submission], owner: User, client: Client
) -> None:
    keys = receipts.read_keys(Client().get(receipts.KEYS_PATH).content)
    assert tuple(receipts.verify(old_receipt, keys).scores) == SCORE_NAMES
    again = client_of(owner).get(f"/api/v1/submissions/{entries[0].pk}/receipt?edition=1")
    assert again.content == old_receipt
    former = document(client, "/api/v1/splits/test/editions/1/board")
    assert all(tuple(row["scores"]) == SCORE_NAMES for row in former["entries"])
    page = page_text(client, "/board/test/editions/1/")
    assert "AE" not in re.findall(r"\w+", page)
    assert "far" not in re.findall(r"\w+", page)
    header = client.get("/board/test/editions/1.csv").content.decode().splitlines()[0]
    assert not any(name in header.split(",") for name in NEW)
    # Further names are no promise to clients of boards that have none of them.
    required = {name for name, field in ScoresSerializer().fields.items() if field.required}
    assert required == set(SCORE_NAMES)
    assert not CountsSerializer().fields["far"].required


def test_names_fit_the_database() -> None:
    for protocol in (*PROTOCOLS.values(), FAR):
        assert all(len(m.name) <= Score._meta.get_field("metric").max_length for m in protocol.metrics)
        assert all(len(i.name) <= Score._meta.get_field("ttc_range").max_length for i in protocol.ranges)
