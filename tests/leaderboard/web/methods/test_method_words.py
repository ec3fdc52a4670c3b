"""What the pages of a method say in sentences: who sees it, where it stands, what its drawings show."""

from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest
from django.utils.safestring import SafeString

from evaluator.metrics.protocol import metric_of
from leaderboard.boards.rows import Entry
from leaderboard.boards.visibility_preview import BoardPreview
from leaderboard.models import Edition, Method, Split, Visibility
from leaderboard.web.methods import visibility_words
from leaderboard.web.methods.result_tables import ResultTable
from leaderboard.web.methods.score_cards import ScoreCard

ENTRY = Entry(
    kind="submission", method="M", team="T", scores={"mid": 1.0}, rank=3, year=2026, n_attempts=1_200
)
PREVIEW = BoardPreview(
    split=Split(name="test"), edition=Edition(number=2), entry=ENTRY, n_ranked=7, n_attempts_now=None
)
DAY = datetime(2027, 3, 1, tzinfo=UTC)


def method(visibility: str, reveal_at: datetime | None = None) -> Method:
    return Method(name="A <b>", visibility=visibility, reveal_at=reveal_at)


def test_private_method_is_offered_both_ways_to_publish_it() -> None:
    own = method(Visibility.PRIVATE)
    words = visibility_words.words(own)
    assert (words.title, words.legend, words.hidden_label) == ("Publish “A <b>”", "Publish it", "Anonymously")
    assert words.lead.endswith("even anonymously, it cannot become private again.")
    assert words.hidden.startswith(f"Everyone sees its scores as “{own.pseudonym}” of team “Anonymous”.")


def test_anonymous_method_is_offered_to_be_public_now_or_later() -> None:
    own = method(Visibility.ANONYMOUS)
    words = visibility_words.words(own)
    assert (words.title, words.legend, words.hidden_label) == (
        "Make “A <b>” public",
        "Make it public",
        "Later",
    )
    assert words.lead == (
        f"At present, everyone sees its scores as “{own.pseudonym}”. "
        "Once public, it cannot become anonymous again."
    )


def test_anonymous_method_with_a_day_names_it() -> None:
    own = method(Visibility.ANONYMOUS, DAY)
    lead = visibility_words.words(own).lead
    assert f"“{own.pseudonym}”, until <time datetime=" in lead
    assert "2027-03-01 00:00 UTC</time>. Once public" in lead


def test_public_method_is_offered_nothing() -> None:
    words = visibility_words.words(method(Visibility.PUBLIC))
    assert (words.title, words.legend, words.hidden) == ("“A <b>” is public", "", "")


@pytest.mark.parametrize(
    ("present", "wanted", "name"),
    [
        (Visibility.PRIVATE, Visibility.PUBLIC, "Publish"),
        (Visibility.PRIVATE, Visibility.ANONYMOUS, "Publish anonymously"),
        (Visibility.ANONYMOUS, Visibility.PUBLIC, "Make public"),
        (Visibility.ANONYMOUS, Visibility.ANONYMOUS, "Save the day"),
    ],
)
def test_button_names_the_step(present: str, wanted: str, name: str) -> None:
    assert visibility_words.button(present, wanted=wanted) == name


@pytest.mark.parametrize(
    ("visibility", "is_named", "is_mine", "start"),
    [
        (Visibility.PRIVATE, True, True, "only your team and the maintainers"),
        (Visibility.ANONYMOUS, True, True, "other teams see neither"),
        (Visibility.ANONYMOUS, False, False, ""),
        (Visibility.PUBLIC, True, True, "public"),
        (Visibility.PUBLIC, True, False, ""),
    ],
)
def test_page_says_to_the_team_who_sees_it(
    visibility: str, start: str, *, is_named: bool, is_mine: bool
) -> None:
    told = visibility_words.seen_by(visibility, is_named=is_named, is_mine=is_mine)
    assert told.startswith(start)
    assert bool(told) == bool(start)


def test_preview_says_where_the_row_stands_and_a_row_without_a_rank_has_none() -> None:
    assert visibility_words.standing(PREVIEW) == "rank 3 of 7, edition 2, dated 2026"
    unranked = replace(PREVIEW, entry=replace(ENTRY, rank=None))
    assert visibility_words.standing(unranked) == "edition 2, dated 2026"


@pytest.mark.parametrize(
    ("wanted", "n_now", "counted"),
    [
        (Visibility.ANONYMOUS, 4, "this method’s scored submissions"),
        (Visibility.PUBLIC, None, "the scored submissions of all your public methods to this split"),
        (
            Visibility.PUBLIC,
            1_100,
            "the scored submissions of all your public methods to this split; "
            "your other public rows, which show 1,100, change to the same number",
        ),
    ],
)
def test_preview_says_what_its_attempts_count(wanted: str, n_now: int | None, counted: str) -> None:
    told = visibility_words.attempts(replace(PREVIEW, n_attempts_now=n_now), wanted=wanted)
    assert told == f"Attempts shown: 1,200 ({counted})."


@pytest.mark.parametrize(
    ("changes", "is_log", "words"),
    [
        ({}, False, "the board, from 8.0 to 80.0; the tall mark is this one."),
        ({}, True, "the board (log scale), from 8.0 to 80.0; the tall mark is this one."),
        ({"visibility": Visibility.PRIVATE}, False, "the tall mark is this one, which is private."),
        ({"rank": None}, False, "the tall mark is this submission, which the board does not show."),
    ],
)
def test_strip_of_a_score_says_what_its_tall_mark_is(
    changes: dict[str, Any], words: str, *, is_log: bool
) -> None:
    card = ScoreCard(
        entry=replace(ENTRY, **changes),
        metric=metric_of("mid"),
        value="8.0",
        interval="",
        rank_range="",
        n_ranked=7,
        gap=None,
        strip=SafeString("<svg></svg>"),
        strip_words="",
        is_log=is_log,
        ends=("8.0", "80.0"),
    )
    assert card.caption.startswith("MiD of every method on the board")
    assert card.caption.endswith(f"{words} Lower is better.")


def test_table_of_results_names_its_metrics_with_their_symbols() -> None:
    metrics = (metric_of("mid"), metric_of("rte"))
    expected = f"{metrics[0].title} (MiD), {metrics[1].title} (RTE)."
    assert ResultTable(metrics=metrics, rows=()).definitions == expected
