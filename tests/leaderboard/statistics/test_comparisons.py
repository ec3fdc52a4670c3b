"""Comparisons of two to five methods: what is answered at once, what a worker adds, and who may ask."""

import uuid
from collections.abc import Mapping
from pathlib import Path

import pytest
from django.contrib.auth.models import AnonymousUser
from django.utils import timezone

from evaluator import SCORE_NAMES, Difference, compare_predictions, read_predictions, rounded
from leaderboard.models import Comparison, Edition, Method, Split, Submission, User, Visibility
from leaderboard.statistics import comparisons
from leaderboard.statistics.comparisons import BadComparison, NotOnTheBoard, UnknownMethod
from leaderboard.storage import files, truth_values
from leaderboard.submissions import intake
from tests import builders
from tests.editions import ANYBODY

pytestmark = [pytest.mark.usefixtures("open_values")]


def ask(
    *sent: Submission, viewer: User | AnonymousUser = ANYBODY, split: str = "test"
) -> comparisons.Compared:
    return comparisons.compare(
        methods=[submission.method_id for submission in sent],
        split=Split.objects.select_related("current_edition__ground_truth").get(pk=split),
        viewer=viewer,
        now=timezone.now(),
    )


def known(pair: comparisons.Pair) -> Mapping[str, Difference]:
    assert pair.differences is not None
    return pair.differences


def set_visibility(submission: Submission, visibility: Visibility) -> None:
    shown_at = None if visibility == Visibility.PRIVATE else timezone.now()
    Method.objects.filter(pk=submission.method_id).update(visibility=visibility, shown_at=shown_at)


@pytest.mark.slow
def test_a_comparison_is_asked_for_once_and_answered_by_a_worker(
    entries: list[Submission], edition: Edition
) -> None:
    first = ask(*entries[:3])
    assert not first.is_complete
    assert [pair.differences for pair in first.pairs] == [None] * 3
    assert [entry.method_id for entry in first.entries] == [sent.method_id for sent in entries[:3]]
    assert not ask(*entries[:3]).is_complete
    assert Comparison.objects.count() == 3
    builders.infer_all()

    answer = ask(*entries[:3])
    assert answer.is_complete
    assert answer.reason == ""
    assert {(pair.first.method, pair.second.method) for pair in answer.pairs} == {
        ("M1.05", "M1.1"),
        ("M1.05", "M1.2"),
        ("M1.1", "M1.2"),
    }
    for pair in answer.pairs:
        assert list(pair.differences) == list(SCORE_NAMES)
        for name, delta in known(pair).items():
            assert delta.difference == rounded(pair.first.scores[name] - pair.second.scores[name], decimals=1)
        overall = known(pair)["mid"]
        assert overall.low <= overall.difference <= overall.high < 0
        assert overall.is_significant
        assert pair.sentence().startswith(f"The MiD of {pair.first.method} is ")
        assert pair.sentence("mid_small").startswith(f"The MiD on small of {pair.first.method} is ")


@pytest.mark.slow
def test_the_worker_computes_what_the_evaluator_says_offline(
    entries: list[Submission], edition: Edition
) -> None:
    ask(*entries[:2])
    builders.infer_all()
    (pair,) = ask(*entries[:2]).pairs
    truth = truth_values.load(edition.ground_truth_id)
    read = []
    for sent in entries[:2]:
        with files.opened_predictions(sent.digest) as kept:
            read.append(read_predictions(kept.read(), manifest=truth.manifest))
    offline = compare_predictions(read[0], read[1], truth, decimals=1)
    for name, difference in known(pair).items():
        assert difference == offline[name], name


@pytest.mark.slow
def test_the_same_pair_the_other_way_round_is_the_same_comparison(entries: list[Submission]) -> None:
    ask(*entries[:2])
    builders.infer_all()
    (pair,), (turned,) = ask(*entries[:2]).pairs, ask(*entries[1::-1]).pairs
    assert Comparison.objects.count() == 1
    for name, difference in known(pair).items():
        other = known(turned)[name]
        assert other.difference == -difference.difference
        assert (other.low, other.high, other.p) == (
            None if difference.high is None else -difference.high,
            None if difference.low is None else -difference.low,
            difference.p,
        )


@pytest.mark.slow
def test_a_method_is_compared_as_it_stands_now(
    entries: list[Submission], edition: Edition, owner: User
) -> None:
    ask(*entries[:2])
    builders.infer_all()
    builders.submit(owner, builders.predictions(edition, factor=1.01), method="M1.1")
    builders.score_all()
    assert not ask(*entries[:2]).is_complete
    builders.infer_all()
    assert known(ask(*entries[:2]).pairs[0])["mid"].difference > 0


def test_unknown_and_invisible_methods_look_alike_to_everybody(
    entries: list[Submission], owner: User, stranger: User
) -> None:
    set_visibility(entries[0], Visibility.PRIVATE)
    texts = []
    for viewer in (ANYBODY, stranger):
        with pytest.raises(UnknownMethod) as refused:
            ask(entries[0], entries[1], viewer=viewer)
        texts.append(str(refused.value).replace(str(entries[0].method_id), "ID"))
    unknown = uuid.uuid4()
    split = Split.objects.select_related("current_edition").get(pk="test")
    with pytest.raises(UnknownMethod) as refused:
        comparisons.compare(
            methods=[unknown, entries[1].method_id], split=split, viewer=ANYBODY, now=timezone.now()
        )
    assert {*texts, str(refused.value).replace(str(unknown), "ID")} == {
        "There is no method ID that you may see; expected one of the board."
    }
    assert not Comparison.objects.exists()
    assert len(ask(entries[0], entries[1], viewer=owner).pairs) == 1


@pytest.mark.slow
def test_an_anonymous_method_is_compared_under_its_pseudonym(entries: list[Submission], owner: User) -> None:
    set_visibility(entries[0], Visibility.ANONYMOUS)
    ask(*entries[:2])
    builders.infer_all()
    pseudonym = Method.objects.get(pk=entries[0].method_id).pseudonym
    assert ask(*entries[:2]).pairs[0].sentence().startswith(f"The MiD of {pseudonym} is ")
    assert "M1.05" not in repr(ask(*entries[:2]))


def test_what_makes_no_comparison_is_refused_in_words(entries: list[Submission], owner: User) -> None:
    many = [entries[0], entries[1], entries[2], entries[3]]
    with pytest.raises(BadComparison, match=r"A comparison needs 2 to 5 methods; found 1\."):
        ask(entries[0])
    with pytest.raises(BadComparison, match=r"found 6\."):
        ask(*many, *many[:2])
    with pytest.raises(BadComparison, match=r"given twice"):
        ask(entries[0], entries[0])
    with pytest.raises(NotOnTheBoard, match=r"Validation has no board"):
        ask(*many, split="val")
    intake.withdraw(submission=entries[0], actor=owner, now=timezone.now())
    with pytest.raises(NotOnTheBoard, match=r"no scored submission on Test"):
        ask(*many)
    codes = {kind.code for kind in (BadComparison, UnknownMethod, NotOnTheBoard)}
    assert codes == {"bad-comparison", "unknown-method", "not-on-the-board"}


@pytest.mark.slow
def test_too_few_recordings_give_differences_without_p(benchmark: None, owner: User, tmp_path: Path) -> None:
    edition = builders.import_truth(tmp_path, n_recordings=7)
    sent = [
        builders.submit(owner, builders.predictions(edition, factor=factor), method=f"M{factor}")
        for factor in (1.1, 1.2)
    ]
    builders.score_all()
    ask(*sent)
    builders.infer_all()
    answer = ask(*sent)
    assert "too few recordings (effective number 6.9; at least 8 needed)" in answer.reason
    overall = known(answer.pairs[0])["mid"]
    assert (overall.low, overall.high, overall.p, overall.is_significant) == (None, None, None, False)
    assert answer.pairs[0].sentence().endswith("at least 8 needed) to say whether that is significant.")


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.05, 1.05 + 1e-7], ids=["the same file", "a file published alike"])
def test_values_published_alike_are_not_significantly_different(
    entries: list[Submission], edition: Edition, stranger: User, factor: float
) -> None:
    other = builders.submit(stranger, builders.predictions(edition, factor=factor), method="Other")
    builders.score_all()
    assert (other.digest == entries[0].digest) == (factor == 1.05)
    ask(entries[0], other)
    builders.infer_all()
    (pair,) = ask(entries[0], other).pairs
    is_same = factor == 1.05
    assert known(pair)["mid"].p == (None if is_same else 1.0)
    for difference in known(pair).values():
        if difference.p is not None:
            assert (difference.difference, difference.p, difference.p_below) == (0.0, 1.0, 1.0)
            assert difference.low <= 0 <= difference.high
    few = " They differ in 0 of 24 recordings." if is_same else ""
    assert pair.sentence() == f"M1.05 and Other have the same MiD to one decimal.{few}"
