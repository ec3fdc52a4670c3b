"""Statistics of hidden values: coarse intervals and classes of p, of public methods of two teams only."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from uuid import UUID

import numpy as np
import pytest
from django.db import transaction
from django.test import Client
from hypothesis import given
from hypothesis import strategies as st
from pytest_django import Settings

from evaluator import SCORE_NAMES, Difference
from leaderboard import board_versions
from leaderboard.boards import listing
from leaderboard.models import (
    Comparison,
    Edition,
    Method,
    Score,
    Split,
    Submission,
    Team,
    User,
    Visibility,
)
from leaderboard.statistics import comparisons, disclosure, recording_sums
from leaderboard.storage import hidden_marks, truth_values
from tests import builders
from tests.editions import ANYBODY
from tests.leaderboard.statistics.test_comparisons import ask, known, set_visibility

Rival = Callable[[float], Submission]


@pytest.fixture
def rival(edition: Edition, stranger: User) -> Rival:
    """A scored public method of another team."""

    def made(factor: float) -> Submission:
        sent = builders.submit(stranger, builders.predictions(edition, factor=factor), method=f"R{factor}")
        builders.score_all()
        return sent

    return made


# --- how fine --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("decimals", [1, 2])
@pytest.mark.parametrize("width", [0.05, 0.3, 1.0, 1.99, 2.0, 7.3, 10.0, 49.9, 320.0])
@pytest.mark.parametrize("middle", [-3.217, 0.013, 14.83, 812.4])
def test_ends_are_rounded_outwards_to_a_tenth_of_the_width(
    decimals: int, width: float, middle: float
) -> None:
    low, high = middle - width / 2, middle + width / 2
    step = disclosure.step_of(high - low, decimals=decimals)
    ends = disclosure.coarse_ends(low, high, decimals=decimals)
    assert step == pytest.approx(10.0**-decimals) or width / 25.1 <= step <= width / 9.9
    assert low - step < ends[0] <= low + 1e-6
    assert high - 1e-6 <= ends[1] < high + step
    for end in ends:
        assert end / step == pytest.approx(round(end / step), abs=1e-6)
        assert end == round(end, decimals)
        assert math.copysign(1, end) == 1 or end < 0


@pytest.mark.parametrize("width", [0.05, 0.3, 1.0, 1.99, 2.0, 7.3, 10.0, 49.9, 320.0])
@pytest.mark.parametrize("middle", [-3.217, 0.013, 14.83, 812.4])
def test_ends_are_never_finer_than_the_step_of_their_edition(width: float, middle: float) -> None:
    low, high = middle - width / 2, middle + width / 2
    ends = disclosure.coarse_ends(low, high, decimals=1, least=0.5)
    step = disclosure.step_of(width, decimals=1, least=0.5)
    assert step == max(0.5, disclosure.step_of(width, decimals=1))
    assert low - step < ends[0] <= low + 1e-6
    assert high - 1e-6 <= ends[1] < high + step
    for end in ends:
        assert end / 0.5 == pytest.approx(round(end / 0.5), abs=1e-6)


def test_an_edition_has_a_step_and_an_earlier_one_keeps_its_own_ends() -> None:
    lows, highs = np.array([13.61, np.nan]), np.array([14.48, np.nan])
    split = Split(is_hidden=True)
    now = Edition(split=split, ground_truth_id="sha256:0", decimals=1)
    earlier = Edition(split=split, ground_truth_id="sha256:0", decimals=1, least_step=None)
    for edition, ends in ((now, (13.5, 14.5)), (earlier, (13.6, 14.5))):
        low, high = disclosure.published_ends(lows, highs, edition=edition)
        assert (low[0], high[0]) == ends
        assert np.isnan([low[1], high[1]]).all()


def published(
    exact: Difference, shown: Difference, *, is_hidden: bool = True, least_step: float | None = None
) -> Difference:
    edition = Edition(
        split=Split(is_hidden=is_hidden), ground_truth_id="sha256:0", decimals=1, least_step=least_step
    )
    return disclosure.published_difference(exact, shown, edition=edition)


@pytest.mark.parametrize(
    ("low", "high", "p", "ends"),
    [
        (0.03, 7.2, 0.049, (0.0, 7.5)),
        (-7.2, -0.03, 0.049, (-7.5, 0.0)),
        (-0.03, 7.2, 0.051, (-0.5, 7.5)),
        (0.4, 0.6, 0.0001, (0.4, 0.6)),
        (-0.13, -0.01, 0.0001, (-0.2, 0.0)),
    ],
)
def test_ends_of_a_difference_are_rounded_outwards_and_p_alone_judges_it(
    low: float, high: float, p: float, ends: tuple[float, float]
) -> None:
    exact = Difference(round((low + high) / 2, 1), low, high, p)
    public = published(exact, exact)
    assert (public.low, public.high) == ends
    assert public.low <= low
    assert high <= public.high
    assert public.p is None
    assert public.is_significant == (p < 0.05)
    assert published(exact, exact, is_hidden=False, least_step=0.5) == exact


def test_a_narrow_interval_of_a_difference_has_the_step_of_its_edition() -> None:
    exact = Difference(0.5, 0.4, 0.6, 0.0001)
    public = published(exact, exact, least_step=0.5)
    assert (public.low, public.high, public.is_significant) == (0.0, 1.0, True)


def test_values_published_alike_are_not_significantly_different() -> None:
    public = published(Difference(0.03, 0.01, 0.05, 0.0001), Difference(0.0, 0.0, 0.1, 1.0))
    assert (public.p, public.p_below) == (None, 1.0)
    assert public.low is not None
    assert public.high is not None
    assert public.low <= 0 <= public.high


def test_too_few_recordings_stay_too_few() -> None:
    few = Difference(1.0, None, None, None, None, 5.3)
    assert published(few, few) == few


def test_a_hidden_split_never_says_in_how_many_recordings_two_methods_differ() -> None:
    few = Difference(0.1, n_effective=300.0, n_different=2, n_units=700)
    many = Difference(0.5, 0.4, 0.6, 0.0001, n_effective=300.0, n_different=600, n_units=700)
    for exact in (few, many):
        assert published(exact, exact, is_hidden=False) == exact
        public = published(exact, exact)
        assert (public.n_different, public.n_units) == (None, None)
        assert (public.p_below is None) == (exact is few)
    assert published(few, few).why_untested == (
        "the methods differ in few recordings, too few to test (at least 6 needed)"
    )


@pytest.mark.slow
def test_nothing_finer_of_a_hidden_split_is_in_the_database(
    entries: list[Submission], edition: Edition, rival: Rival
) -> None:
    ask(entries[0], rival(1.07))
    builders.infer_all()
    for low, high in Score.objects.filter(low__isnull=False).values_list("low", "high"):
        step = disclosure.step_of(0.8 * (high - low), decimals=1, least=edition.least_step)
        assert (low / step, high / step) == pytest.approx((round(low / step), round(high / step)), abs=1e-6)
    (row,) = Comparison.objects.all()
    for difference in row.differences.values():
        assert difference["p"] is None


@pytest.mark.slow
def test_p_is_a_class_in_every_form(entries: list[Submission], rival: Rival, client: Client) -> None:
    other = rival(1.3)
    ask(entries[0], other)
    builders.infer_all()
    (pair,) = ask(entries[0], other).pairs
    difference = known(pair)["mid"]
    assert (difference.p, difference.p_below, difference.is_significant) == (None, 0.001, True)
    query = {"split": "test", "m": [str(entries[0].method_id), str(other.method_id)]}
    answer = client.get("/api/v1/compare", query).json()["pairs"][0]
    assert answer["withheld"] == ""
    assert {name: each["p"] for name, each in answer["differences"].items()} == dict.fromkeys(SCORE_NAMES)
    assert answer["differences"]["mid"]["p_below"] == 0.001
    assert "p < 0.001)" in answer["sentence"]
    page = client.get("/compare/", query).text
    assert "&lt; 0.001</td>" in page
    assert (
        "so the ends of the intervals are rounded outwards: 0 may be an end although p is below 0.05." in page
    )


# --- of which pairs --------------------------------------------------------------------------------------


def plain(pair: comparisons.Pair) -> None:
    """Assert that this pair has only the difference of the board's values."""
    for name, difference in known(pair).items():
        one, other = pair.first.scores[name], pair.second.scores[name]
        assert one is not None
        assert other is not None
        assert difference == Difference(round(one - other, 1) + 0.0, None, None, None)
    assert Comparison.objects.count() == 0


def test_two_methods_of_one_team_are_not_compared_on_a_hidden_split(
    entries: list[Submission], owner: User, stranger: User
) -> None:
    for viewer in (owner, stranger):
        answer = ask(*entries[:2], viewer=viewer)
        assert answer.is_complete
        plain(answer.pairs[0])
        assert answer.pairs[0].withheld == (
            "No confidence interval and no p-value: both methods are of one team, and the ground truth of "
            "Test is hidden. There, only public methods of different teams are compared; compare these two "
            "on a split with open ground truth, or their files offline with tsttc compare."
        )


@pytest.mark.parametrize("seen", [Visibility.PRIVATE, Visibility.ANONYMOUS])
def test_what_is_not_public_is_not_compared_on_a_hidden_split_by_its_own_team_either(
    entries: list[Submission], owner: User, rival: Rival, seen: Visibility
) -> None:
    other = rival(1.07)
    set_visibility(entries[0], seen)
    (pair,) = ask(entries[0], other, viewer=owner).pairs
    plain(pair)
    assert "M1.05 is not public" in pair.withheld


@pytest.mark.slow
@pytest.mark.parametrize("is_hidden", [True, False])
def test_an_anonymous_method_of_another_team_is_compared_once_it_is_public(
    entries: list[Submission], owner: User, stranger: User, rival: Rival, is_hidden: bool
) -> None:
    Split.objects.filter(pk="test").update(is_hidden=is_hidden)
    other = rival(1.07)
    set_visibility(other, Visibility.ANONYMOUS)
    (pair,) = ask(entries[0], other, viewer=owner).pairs
    plain(pair)
    assert pair.second.method in pair.withheld
    assert pair.second.method.startswith("Anonymous")
    assert "have no interval or p-value until the method is public" in pair.sentence()
    # Its own team may, where the values are open.
    (pair,) = ask(entries[0], other, viewer=stranger).pairs
    assert bool(pair.withheld) == is_hidden

    set_visibility(other, Visibility.PUBLIC)
    with transaction.atomic():
        board_versions.bump("test")
    (pair,) = ask(entries[0], other, viewer=owner).pairs
    assert pair.withheld == ""


# --- whatever the database says --------------------------------------------------------------------------


@pytest.mark.slow
def test_calling_a_hidden_split_open_in_the_database_tells_no_more_of_it(
    entries: list[Submission], edition: Edition, owner: User, rival: Rival, client: Client
) -> None:
    """The attack of a person who has the web process: `is_hidden = false`, and everything computed again."""
    other = rival(1.07)
    ask(entries[0], other)
    builders.infer_all()
    scores = Score.objects.order_by("pk").values_list("low", "high")
    before, (stored,) = list(scores), Comparison.objects.values_list("differences", flat=True)

    Comparison.objects.all().delete()
    Score.objects.update(low=None, high=None)
    Edition.objects.update(inference_digest="")
    Split.objects.filter(pk="test").update(is_hidden=False)
    set_visibility(entries[1], Visibility.PRIVATE)
    own = (entries[0], entries[2]), (entries[0], entries[1])
    for sent in ((entries[0], other), *own):
        ask(*sent, viewer=owner)
    builders.infer_all()

    assert list(scores.all()) == before
    assert stored in Comparison.objects.values_list("differences", flat=True)
    for sent in own:
        (pair,) = ask(*sent, viewer=owner).pairs
        for delta in known(pair).values():
            assert (delta.low, delta.high, delta.p, delta.p_below) == (None, None, None, None)
        assert pair.withheld == (
            "No confidence interval and no p-value: the ground truth of Test was imported as hidden. There, "
            "only public methods of different teams are compared; compare these two on a split with open "
            "ground truth, or their files offline with tsttc compare."
        )
        query = {"split": "test", "m": [str(each.method_id) for each in sent]}
        client.force_login(owner)
        assert client.get("/api/v1/compare", query).json()["pairs"][0]["withheld"] == pair.withheld
        assert pair.withheld in client.get("/compare/", query).text


@pytest.mark.parametrize("is_marked", [True, False])
@pytest.mark.parametrize(
    ("teams", "visibilities", "is_published"),
    [
        ((1, 2), ("PUBLIC", "PUBLIC"), True),
        ((1, 1), ("PUBLIC", "PUBLIC"), False),
        ((1, 2), ("PUBLIC", "PRIVATE"), False),
        ((1, 2), ("PRIVATE", "PUBLIC"), False),
        ((1, 2), ("ANONYMOUS", "PUBLIC"), False),
    ],
)
def test_a_mark_withholds_what_is_not_public_or_of_one_team_where_the_database_says_open(
    edition: Edition,
    is_marked: bool,
    teams: tuple[int, int],
    visibilities: tuple[str, str],
    is_published: bool,
) -> None:
    edition.split.is_hidden = False
    if not is_marked:
        hidden_marks.path(edition.ground_truth_id).unlink(missing_ok=True)
    assert hidden_marks.is_marked(edition.ground_truth_id) is is_marked
    first, second = (
        Submission(method=Method(team=Team(pk=UUID(int=team)), visibility=visibility))
        for team, visibility in zip(teams, visibilities, strict=True)
    )
    why = disclosure.why_withheld_by_mark(first, second, edition=edition)
    assert (why == "") is (is_published or not is_marked)


@pytest.mark.slow
@given(
    st.floats(-50, 50),
    st.floats(0, 9),
    st.floats(0, 9),
    st.sampled_from([0.1, 0.5, 1.0]),
    st.sampled_from([1, 2]),
)
def test_the_published_interval_of_a_hidden_difference_holds_both_differences(
    middle: float, below: float, above: float, least_step: float, decimals: int
) -> None:
    # The shown difference is that of two rounded values, and may lie outside of the computed interval.
    low, high = middle - below, middle + above
    exact = Difference(middle, low, high, 0.01)
    for shown in (round(middle, decimals), round(middle + 0.1, decimals), round(middle - 0.1, decimals)):
        public = published(exact, replace(exact, difference=shown), least_step=least_step)
        assert public.low <= min(shown, low) + 1e-9
        assert max(shown, high) - 1e-9 <= public.high


def test_withheld_pairs_of_a_board_are_not_computed_for_the_database_either(
    entries: list[Submission], edition: Edition, rival: Rival
) -> None:
    def noted() -> set[frozenset[str]]:
        rows = Comparison.objects.values_list("first__submission", "second__submission")
        return {frozenset(map(str, row)) for row in rows}

    split = Split.objects.select_related("current_edition__ground_truth").get(pk="test")
    comparisons.of_first(board=listing.board(split=split, viewer=ANYBODY))
    assert noted() == set(), "all are of one team"
    other = rival(1.07)
    set_visibility(entries[0], Visibility.ANONYMOUS)
    comparisons.of_first(board=listing.board(split=split, viewer=ANYBODY))
    assert noted() == {frozenset([str(other.pk), str(sent.pk)]) for sent in entries[1:]}


def test_sums_and_truth_are_for_the_owner_of_the_process_alone(
    entries: list[Submission], edition: Edition, settings: Settings
) -> None:
    builders.infer_all()
    sums = recording_sums.path(edition, file=entries[0].sent_file)
    modes = [path.stat().st_mode & 0o777 for path in (sums, sums.parent, Path(settings.GROUND_TRUTH_DIR))]
    assert modes == [0o600, 0o700, 0o700]
    values = truth_values.values_path(edition.ground_truth_id)
    assert values.stat().st_mode & 0o077 == 0
