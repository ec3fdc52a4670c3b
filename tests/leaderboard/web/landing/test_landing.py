"""The landing page: what time to contact is, who leads and how surely, and where to go from there."""

import json
import re
from datetime import timedelta

import msgspec
import pytest
from django.conf import settings
from django.test import Client
from django.utils import timezone
from pytest_django.fixtures import Settings

from leaderboard.models import Edition, PublishedResult, Split, Submission, User
from leaderboard.web.landing.landing_views import main_split
from tests import builders, pages
from tests.editions import publish, roll_back


def landing(client: Client) -> pages.Element:
    return pages.get(client, "/").one("main")


def panel(client: Client, name: str) -> pages.Element:
    return landing(client).one("section", **{"aria-labelledby": name})


def alone(client: Client) -> str:
    """The sentence on the lead, without the link behind it."""
    return landing(client).one("span", class_="lead-words").text.removesuffix(" Uncertainty")


# --- what it shows ---------------------------------------------------------------------------------------


def test_the_leaders_are_the_first_rows_of_the_main_board(client: Client, benchmark: None) -> None:
    rows = landing(client).one("ol", class_="leaders").all("li")
    board = pages.board_rows(pages.get(client, "/board/test/"))[:3]
    assert [row.one("span", class_="number").text for row in rows] == [row[2] for row in board]
    names = [row.one("p", class_="name").text for row in rows]
    assert all(row[1].startswith(name) for row, name in zip(board, names, strict=True))


def test_each_ttc_range_names_its_leaders_and_their_value(client: Client, benchmark: None) -> None:
    rows = [[cell.text for cell in row.all("th") + row.all("td")] for row in _range_rows(client)]
    assert rows == [
        ["0–3 s crucial", "Deep Scale", "27.6"],
        ["3–6 s small", "Deep Scale and Deep Scale (NeRF)", "15.6"],
        ["6–20 s large", "Deep Scale and Deep Scale (NeRF)", "11.5"],
        ["−20–0 s negative", "Deep Scale", "13.7"],
    ]


@pytest.mark.slow
def test_a_leader_has_its_interval_or_says_that_it_has_none_and_a_quoted_one_has_neither(
    client: Client, edition: Edition, owner: User, open_values: None
) -> None:
    assert _notes(client)[0] == []
    PublishedResult.objects.all().delete()
    for factor in (1.01, 2.0):
        builders.submit(owner, builders.predictions(edition, factor=factor), method=f"Times {factor}")
    builders.score_all()
    assert _notes(client) == [["no confidence interval"]] * 2
    builders.infer_all()
    assert all(re.fullmatch(r"95% CI [\d.]+ to [\d.]+", notes[0]) for notes in _notes(client))


def _notes(client: Client) -> list[list[str]]:
    """What stands below the value of each leader."""
    rows = landing(client).one("ol", class_="leaders").all("li")
    return [[note.text for note in row.one("div", class_="value").all("p", class_="quiet")] for row in rows]


def _range_rows(client: Client) -> list[pages.Element]:
    return panel(client, "leaders").one("table").one("tbody").all("tr")


def test_its_facts_are_those_of_the_file_and_counts_of_real_ground_truth(
    client: Client, edition: Edition
) -> None:
    truth = edition.ground_truth
    facts = landing(client).one("dl", class_="figures")
    assert [each.text for each in facts.all("dd")] == [
        f"{truth.n_sequences:,}",
        f"{truth.n_recordings:,}",
        "206,000",
        "6 frames",
        "4 TTC ranges",
    ]
    Split.objects.filter(pk="test").update(is_simulated=True)
    builders.board_changed("test")
    facts = landing(client).one("dl", class_="figures")
    assert facts.all("dd")[0].text == "206,000"


def filled_buttons(client: Client) -> list[pages.Element]:
    return [each for each in landing(client).all("a", class_="button") if "plain" not in each.classes]


@pytest.mark.slow
def test_its_one_filled_button_leads_to_a_split_that_is_open(client: Client, edition: Edition) -> None:
    (button,) = filled_buttons(client)
    assert (button.text, button.attributes["href"]) == ("Submit", "/submit/?split=test")
    Split.objects.filter(pk="demo").update(current_edition=edition)
    Split.objects.filter(pk="test").update(closes_at=timezone.now())
    builders.board_changed("test")
    (button,) = filled_buttons(client)
    assert (button.text, button.attributes["href"]) == ("Try a submission (demo)", "/submit/?split=demo")
    Split.objects.filter(pk="demo").update(is_simulated=False)
    builders.board_changed("demo")
    (button,) = filled_buttons(client)
    assert button.text == "Submit to Demo"
    Split.objects.filter(pk="demo").update(current_edition=None)
    builders.board_changed("demo")
    assert filled_buttons(client) == []


@pytest.mark.slow
def test_editions_are_linked_of_a_split_that_has_one(client: Client, edition: Edition) -> None:
    assert links_of_trust(client)["Editions and changelog"] == "/board/test/editions/"
    Split.objects.filter(pk="demo").update(current_edition=edition)
    Split.objects.filter(pk="test").update(current_edition=None)
    builders.board_changed("test")
    assert links_of_trust(client)["Editions and changelog"] == "/board/demo/editions/"


def links_of_trust(client: Client) -> dict[str, str | None]:
    return {each.text: each.attributes["href"] for each in panel(client, "trust").all("a")}


def test_what_one_downloads_to_submit_is_one_click_away(client: Client, edition: Edition) -> None:
    links = {
        each.text: each.attributes["href"] for each in landing(client).one("div", class_="hero").all("a")
    }
    assert links["Get the data"] == settings.BENCHMARK.dataset.url
    assert links["template (JSON) of Test"] == "/submit/template/test.json"
    assert links["manifest (sequence list, CSV) of Test"] == "/api/v1/splits/test/manifest"


@pytest.mark.slow
def test_a_private_method_leads_nowhere_on_it_not_even_for_its_own_team(
    signed_in: Client, client: Client, edition: Edition, owner: User
) -> None:
    data = builders.predictions(edition, factor=1.001)
    builders.submit(owner, data, method="Secret", visibility="PRIVATE")
    builders.score_all()
    assert b"Secret" not in signed_in.get("/").content
    assert b"Secret" not in Client().get("/").content


@pytest.mark.slow
def test_without_a_split_an_entry_or_with_one_entry_it_says_so(
    client: Client, edition: Edition, owner: User
) -> None:
    PublishedResult.objects.all().delete()
    builders.board_changed("test")
    assert "There are no ranked results on Test yet." in panel(client, "leaders").text
    builders.submit(owner, builders.predictions(edition), method="Alone")
    builders.score_all()
    (row,) = panel(client, "leaders").all("li")
    assert row.one("p", class_="name").text == "Alone"
    assert landing(client).all("span", class_="lead-words") == []
    assert main_split([]) is None


def test_a_site_without_any_split_has_a_landing_page_and_no_main_board(client: Client, db: None) -> None:
    PublishedResult.objects.all().delete()
    Split.objects.all().delete()
    assert "There is no board yet." in panel(client, "boards").text
    assert client.get("/board/").status_code == 404


# --- whether the lead is significant ---------------------------------------------------------------------


def test_a_lead_of_rows_from_papers_is_not_known_to_be_significant(client: Client, benchmark: None) -> None:
    assert alone(client) == (
        "We cannot tell whether the lead is significant: the paper reports no values per recording."
    )


@pytest.mark.slow
def test_the_lead_is_as_significant_as_the_rank_range_of_the_first_row_says(
    client: Client, edition: Edition, owner: User, open_values: None
) -> None:
    PublishedResult.objects.all().delete()
    for name, factor in (("First", 1.01), ("Last", 2.0)):
        builders.submit(owner, builders.predictions(edition, factor=factor), method=name)
    builders.score_all()
    assert alone(client).endswith("the confidence intervals are being computed.")
    builders.infer_all()
    assert alone(client) == "The lead of First is significant (95% confidence)."
    builders.submit(owner, builders.predictions(edition, factor=1.01), method="Twin")
    builders.score_all()
    builders.infer_all()
    assert alone(client) == "First and Twin share the first rank."


# --- dates and news --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_dates_are_the_splits_and_for_the_signed_in_what_their_team_has_left(
    client: Client, edition: Edition, owner: User
) -> None:
    closes_at = timezone.now() + timedelta(days=3)
    Split.objects.filter(pk="test").update(closes_at=closes_at, quota_limit=2)
    builders.board_changed("test")
    closing = f"Submissions to Test close at {closes_at:%Y-%m-%d %H:%M} UTC."
    assert closing in panel(client, "boards").text
    client.force_login(owner)
    text = panel(client, "boards").text
    assert closing in text
    assert "2 of 2" in text


@pytest.mark.slow
def test_news_are_editions_and_entries_the_newest_first(
    client: Client, rescored: Edition, entries: list[Submission]
) -> None:
    publish(rescored)
    roll_back()
    links = [a.text for a in panel(client, "news").one("ol").all("a")]
    assert links[:2] == ["Test, edition 1", "Test, edition 2"]
    assert links[2:] == [f"M{factor}" for factor in (1.4, 1.2, 1.1)]
    text = panel(client, "news").text
    assert "current again: edition 2 was rolled back" in text
    assert "replaced edition 1: " in text
    assert "by Owls, rank " in text


def test_there_are_no_news_of_simulated_data(
    client: Client, rescored: Edition, entries: list[Submission]
) -> None:
    publish(rescored)
    Split.objects.filter(pk="test").update(is_simulated=True)
    builders.board_changed("test")
    assert landing(client).all("h2", id="news") == []


@pytest.mark.slow
def test_news_name_an_anonymous_method_by_its_pseudonym(
    client: Client, edition: Edition, owner: User
) -> None:
    sent = builders.submit(owner, builders.predictions(edition), method="Shy", visibility="ANONYMOUS")
    builders.score_all()
    text = panel(client, "news").text
    assert sent.method.pseudonym in text
    assert not {"Shy", "Owls"} & set(landing(client).text.split())


# --- for search engines ----------------------------------------------------------------------------------


def test_search_engines_learn_what_the_dataset_is(client: Client, benchmark: None) -> None:
    (script,) = pages.get(client, "/").all("script", type="application/ld+json")
    dataset = json.loads(script.raw_text)
    assert (dataset["@context"], dataset["@type"], dataset["name"]) == (
        "https://schema.org",
        "Dataset",
        "TSTTC",
    )
    assert dataset["creator"][0] == {"@type": "Person", "name": "Yuheng Shi"}
    assert [part["name"] for part in dataset["hasPart"]] == [
        "TSTTC, Test",
        "TSTTC, Validation",
        "TSTTC, Demo",
    ]
    assert dataset["hasPart"][1]["url"].endswith("/board/val/")


def test_search_engines_read_names_as_they_are_written(
    client: Client, benchmark: None, settings: Settings
) -> None:
    paper = msgspec.structs.replace(settings.BENCHMARK.paper, authors=("A. O'Brien", "B. <Bee> & Sons"))
    settings.BENCHMARK = msgspec.structs.replace(settings.BENCHMARK, paper=paper)
    (script,) = pages.get(client, "/").all("script", type="application/ld+json")
    dataset = json.loads(script.raw_text)
    assert [each["name"] for each in dataset["creator"]] == ["A. O'Brien", "B. <Bee> & Sons"]
    assert dataset["citation"].startswith(f"A. O'Brien, B. <Bee> & Sons ({paper.year}). {paper.title}. ")
