"""The page that sets two to five methods side by side."""

import json
import re
from pathlib import Path

import pytest
from django.test import Client

from leaderboard.models import Comparison, Edition, Split, Submission, User
from tests import board_rows, builders, pages

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("open_values")]


def get(client: Client, *methods: object, split: str = "test", status: int = 200) -> pages.Element:
    response = client.get("/compare/", {"split": split, "m": [str(pk) for pk in methods]})
    assert response.status_code == status, response.content.decode()
    return pages.page(response)


def words(root: pages.Element) -> str:
    return root.one("main").text


def test_asked_at_once_it_says_that_it_is_being_computed_and_asks_again_by_itself(
    client: Client, entries: list[Submission]
) -> None:
    ids = [entry.method_id for entry in entries[:2]]
    root = get(client, *ids)
    assert "being computed" in words(root)
    assert root.one("noscript").one("meta").attributes["http-equiv"] == "refresh"
    assert root.one("div", id="comparison").attributes["hx-trigger"] == "every 1s"
    builders.infer_all()
    root = get(client, *ids)
    assert "being computed" not in words(root)
    assert root.all("noscript") == []
    assert "hx-trigger" not in root.one("div", id="comparison").attributes


def test_verdict_comes_first_then_every_difference_with_interval_and_p(
    client: Client, entries: list[Submission]
) -> None:
    near, far = entries[0], entries[-1]
    get(client, near.method_id, far.method_id)
    builders.infer_all()
    root = get(client, near.method_id, far.method_id)
    verdict = root.one("p", class_="verdict").text
    assert verdict.startswith(f"The MiD of {near.method.name} is ")
    assert f"lower than that of {far.method.name} (95% confidence interval: " in verdict
    lead = root.one("p", class_="others").text
    assert lead.startswith("5 of the 5 other metrics differ"), "the others have too few recordings"
    assert len(root.one("table", class_="differences").all("tr", class_="significant")) == 6
    rows = [
        row for row in root.one("table", class_="differences").all("tr") if row.all("svg", class_="whisker")
    ]
    assert len(rows) == 10
    for row in rows:
        first, second, difference = (float(cell.text.replace("−", "-")) for cell in row.all("td")[:3])
        assert difference == pytest.approx(first - second, abs=0.011)
        *_, interval, p = (cell.text for cell in row.all("td"))
        assert p == "too few recordings" or (" to " in interval and 0 < float(p.removeprefix("≤ ")) <= 1)
    series = json.loads(root.one("figure").one("script").raw_text)["baseOption"]["series"]
    assert len(series) >= 2
    assert len(root.one("figure").one("tbody").all("tr")) == 10


def test_five_methods_are_one_verdict_a_matrix_and_ten_closed_pairs(
    client: Client, edition: Edition, owner: User
) -> None:
    sent = [
        builders.submit(owner, builders.predictions(edition, factor=1.05 + i / 5), method=f"M{i}")
        for i in range(5)
    ]
    builders.score_all()
    ids = [each.method_id for each in sent]
    get(client, *ids)
    builders.infer_all()
    root = get(client, *ids)
    assert len(root.all("section", class_="pair")) == 10
    assert root.one("p", class_="verdict").text.startswith("Of these five, M0 has the lowest MiD, ")
    assert root.one("p", class_="verdict").text.endswith(
        "It is significantly better than the other four (corrected for all 10 pairs)."
    )
    assert all(len(pair.all("p", class_="others")) == 1 for pair in root.all("section", class_="pair"))
    assert all("open" not in each.attributes for each in root.one("div", id="comparison").all("details"))
    matrix = [
        [cell.text for cell in row.all("td")[1:]] for row in root.one("table", class_="matrix").all("tr")[1:]
    ]
    assert [row[i] for i, row in enumerate(matrix)] == [""] * 5
    assert matrix[0][1].startswith("−")
    assert matrix[0][1].endswith("*, significantly better")
    assert matrix[1][0] == matrix[0][1].replace("−", "+").replace("better", "worse")
    forest = root.one("table", class_="forest").one("tbody").all("tr")
    assert [row.one("th").text for row in forest] == ["M0", "M1", "M2", "M3", "M4"]
    for row, (worse, *_) in zip(forest[1:], matrix[1:], strict=True):
        low, high = (float(end) for end in row.all("td")[1].text.split(" to "))
        assert 0 < low <= float(worse.partition("*")[0]) <= high
    assert forest[1].all("td")[-1].text == "≤ 0.0001", "the smallest p that the test can give"


def test_a_difference_without_a_test_has_no_star(client: Client, entries: list[Submission]) -> None:
    Split.objects.filter(pk="test").update(is_hidden=True)  # of one team: not tested on hidden labels
    ids = [entry.method_id for entry in entries[:3]]
    root = get(client, *ids)
    cells = [cell.text for cell in root.one("table", class_="matrix").all("td") if "," in cell.text]
    assert [cell.rpartition(", ")[2] for cell in cells] == ["no test"] * 6
    assert root.all("table", class_="forest") == []


def test_every_bad_question_has_a_page_that_says_what_is_wrong(
    client: Client, entries: list[Submission], owner: User
) -> None:
    secret = builders.submit(owner, b"{}", method="Secret", visibility="PRIVATE")
    ids = [entry.method_id for entry in entries]
    for methods, split, status, sentence in (
        (["x", ids[0]], "test", 404, "There is no method 'x'; expected an identifier"),
        ([ids[0], secret.method_id], "test", 404, "that you may see"),
        ([ids[0]], "test", 400, "A comparison needs 2 to 5 methods; found 1."),
        (ids[:2], "nowhere", 404, "There is no split 'nowhere'; expected one of test, val, demo."),
    ):
        root = get(client, *methods, split=split, status=status)
        assert sentence in root.one("p", class_="notice").text, (sentence, words(root))
        assert root.all("svg", class_="whisker") == []


def test_without_methods_it_offers_those_of_the_board(client: Client, entries: list[Submission]) -> None:
    root = get(client)
    offered = [box.attributes["value"] for box in root.all("input", type="checkbox")]
    assert offered == [str(entry.method_id) for entry in entries]
    # As many decimals as the edition publishes: the test split's have one.
    rows = [row.text for row in root.one("tbody").all("tr")]
    assert all(re.search(r"Owls( \d+\.\d){2,}$", text.strip()) for text in rows), rows
    assert "No method has a score on Demo yet." in words(get(client, split="demo"))


def test_first_fifty_are_offered_and_what_is_chosen_beyond_them(
    client: Client, edition: Edition, owner: User
) -> None:
    board_rows.fill(edition, n=53, user=owner)
    offered = [box.attributes["value"] for box in get(client).all("input", type="checkbox")]
    assert len(offered) == 50
    board = client.get("/api/v1/splits/test/board").json()["entries"]
    ranked = [entry["method_id"] for entry in board if entry["kind"] == "submission"]
    assert offered == ranked[:50]
    root = pages.page(client.get("/compare/", {"split": "test", "with": ranked[-1]}))
    assert [box.attributes["value"] for box in root.all("input", type="checkbox")] == [*offered, ranked[-1]]


def test_choice_of_others_beside_a_method_has_it_ticked(client: Client, entries: list[Submission]) -> None:
    beside = entries[-1].method_id
    root = pages.page(client.get("/compare/", {"split": "test", "with": str(beside)}))
    ticked = [box for box in root.all("input", type="checkbox") if "checked" in box.attributes]
    assert [box.attributes["value"] for box in ticked] == [str(beside)]


def test_too_few_recordings_are_named_and_no_p_is_shown(
    client: Client, benchmark: None, owner: User, tmp_path: pytest.TempPathFactory
) -> None:
    edition = builders.import_truth(tmp_path, n_recordings=7)
    sent = [
        builders.submit(owner, builders.predictions(edition, factor=factor), method=f"M{factor}")
        for factor in (1.1, 1.5)
    ]
    builders.score_all()
    ids = [each.method_id for each in sent]
    get(client, *ids)
    builders.infer_all()
    root = get(client, *ids)
    assert "too few recordings (effective number 6.9; at least 8 needed)" in words(root)
    assert "95% CI" not in [head.text for head in root.one("table", class_="differences").all("th")]
    assert root.all("p", class_="others") == []
    board = pages.page(client.get("/board/test/"))
    assert "too few recordings (effective number 6.9; at least 8 needed)" in board.one("main").text
    assert board.all("line", class_="span") == [], "values are rings, without intervals"


def test_the_page_says_on_how_few_recordings_the_difference_rests(
    client: Client, entries: list[Submission]
) -> None:
    ids = [entries[0].method_id, entries[1].method_id]
    get(client, *ids)
    builders.infer_all()
    # Every recording favours this one, so no number leaves enough of them for a test.
    row = Comparison.objects.get()
    assert row.differences
    assert row.differences["mid"]["influence"]["n_to_undecided"] is None
    row.differences["mid"]["influence"] |= {"n_to_undecided": 3, "n_to_turn": 5, "is_turn_significant": True}
    row.save()
    sentence = get(client, *ids).one("p", class_="influence").text
    assert re.fullmatch(
        r"How robust is this\? If the \d+ of \d+ recordings that most favour M1.05 are left out, the "
        r"difference is no longer significant\.( If \d+ are left out, M\S+ is significantly better\.)?",
        sentence,
    ), sentence


def test_of_a_hidden_split_nobody_learns_on_how_few_recordings_a_difference_rests(
    client: Client, entries: list[Submission], edition: Edition, stranger: User
) -> None:
    Split.objects.filter(pk="test").update(is_hidden=True)
    rival = builders.submit(stranger, builders.predictions(edition, factor=1.3), method="Rival")
    builders.score_all()
    ids = [entries[0].method_id, rival.method_id]
    get(client, *ids)
    builders.infer_all()
    root = get(client, *ids)
    assert "(95% confidence interval: " in root.one("p", class_="verdict").text
    assert root.all("p", class_="influence") == []
    (kept,) = Comparison.objects.values_list("differences", flat=True)
    assert {difference["influence"] for difference in kept.values()} == {None}


def test_what_was_chosen_of_several_submissions_is_shown_and_what_that_is_worth(
    client: Client, entries: list[Submission], edition: Edition, owner: User
) -> None:
    ids = [entries[0].method_id, entries[1].method_id]
    get(client, *ids)
    builders.infer_all()
    assert get(client, *ids).all("dd", class_="selection") == [], "one submission each: nothing was chosen"
    name = entries[0].method.name
    for factor in (1.8, 1.9):
        builders.submit(owner, builders.predictions(edition, factor=factor), method=name)
    builders.score_all()
    builders.infer_all()
    sentence = (
        f"{name} is the best of 3 scored submissions. Picking the best of several equally good submissions "
        "makes a method look better by chance: by up to about 0.60 standard errors of the difference if the "
        "best of 3 is picked."
    )
    assert get(client, *ids).one("dd", class_="selection").text == sentence
    method_page = pages.page(client.get(f"/methods/{ids[0]}/"))
    assert method_page.one("p", class_="selection").text == sentence
    other = pages.page(client.get(f"/methods/{ids[1]}/"))
    assert other.all("p", class_="selection") == []


def test_choice_opens_on_the_first_split_whose_submissions_are_scored(
    client: Client, benchmark: None, tmp_path: Path
) -> None:
    assert "No method has a score on Test yet." in words(pages.page(client.get("/compare/")))
    builders.import_truth(tmp_path, split="val")
    builders.board_changed("val")
    assert "No method has a score on Validation yet." in words(pages.page(client.get("/compare/")))
