"""Whose comparison is computed next: nobody's questions keep anybody else's waiting."""

import itertools
from datetime import timedelta
from typing import Any

import pytest
from django.contrib.auth.models import AnonymousUser
from django.test import Client
from django.utils import timezone

from leaderboard.models import Comparison, Edition, Evaluation, Question, Submission, User
from leaderboard.scoring import questions
from leaderboard.scoring.questions import Asker, TooManyWaiting
from leaderboard.storage import truth_values
from leaderboard.workers import upkeep
from tests import builders
from tests.leaderboard.web.maintain import queue_rows

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("open_values")]
Pairs = list[tuple[Any, Any]]
ANYBODY = AnonymousUser()


@pytest.fixture
def pairs(edition: Edition, owner: User) -> Pairs:
    """All 528 pairs of 33 evaluations."""
    made = [queue_rows.queued(edition, owner).pk for _ in range(33)]
    return list(itertools.combinations(sorted(made), 2))


def visitor(address: str) -> Asker:
    return questions.asker_of(user=ANYBODY, address=address)


def ask(edition: Edition, asker: Asker, *pairs: tuple[Any, Any], ago_s: float = 0) -> bool:
    """Whether there was a place."""
    try:
        questions.ask(
            edition=edition, pairs=pairs, asker=asker, now=timezone.now() - timedelta(seconds=ago_s)
        )
    except TooManyWaiting:
        return False
    return True


def upcoming() -> tuple[Any, Any]:
    """The pair whose turn it is, which has had it with that."""
    row = questions.waiting(held=truth_values.readable_digests())[0]
    questions.begin(row, now=timezone.now())
    Comparison.objects.filter(pk=row.pk).update(computed_at=timezone.now(), differences={})
    questions.end(row)
    return row.first_id, row.second_id


def test_five_hundred_questions_of_one_asker_leave_a_newcomer_the_next_turn(
    edition: Edition, pairs: Pairs
) -> None:
    flood = visitor("192.0.2.1")
    assert sum(ask(edition, flood, pair, ago_s=5) for pair in pairs[:500]) == questions.MAX_PLACES
    assert upcoming() == pairs[0]
    ask(edition, visitor("192.0.2.2"), pairs[510])
    assert upcoming() == pairs[510]


def test_askers_take_turns_and_each_ones_oldest_is_first(edition: Edition, pairs: Pairs) -> None:
    for number in range(3):
        for name in ("a", "b"):
            ask(edition, visitor(name), pairs[number if name == "a" else 10 + number], ago_s=9 - number)
    wanted = [pairs[n] for n in (0, 10, 1, 11, 2, 12)]
    assert [upcoming() for _ in wanted] == wanted


def test_who_is_signed_in_goes_before_visitors_who_came_first(
    edition: Edition, pairs: Pairs, owner: User
) -> None:
    for number in range(5):
        ask(edition, visitor(f"192.0.2.{number}"), pairs[number], ago_s=9)
    ask(edition, questions.asker_of(user=owner, address="192.0.2.9"), pairs[20], pairs[21])
    assert upcoming() == pairs[20]
    assert [upcoming() for _ in range(6)] == [*pairs[:5], pairs[21]], "then visitors have their turn"


def test_a_pair_that_two_ask_for_has_the_earlier_turn(edition: Edition, pairs: Pairs, owner: User) -> None:
    flood = visitor("192.0.2.1")
    for pair in pairs[:10]:
        ask(edition, flood, pair, ago_s=9)
    ask(edition, questions.asker_of(user=owner, address=""), pairs[9])
    assert upcoming() == pairs[9]
    assert Comparison.objects.count() == 10


def test_asking_again_for_the_same_takes_no_place(edition: Edition, pairs: Pairs) -> None:
    asker = visitor("192.0.2.1")
    for _ in range(3):
        assert ask(edition, asker, *pairs[: questions.MAX_PLACES])
    with pytest.raises(TooManyWaiting) as caught:
        questions.ask(edition=edition, pairs=pairs[30:31], asker=asker, now=timezone.now())
    assert str(caught.value) == (
        "You wait for 20 comparisons and have asked for 1 more; expected at most 20 at a time. "
        "They are being computed: ask again in 10 s."
    )
    questions.end(Comparison.objects.all()[0])
    assert ask(edition, asker, pairs[30])


def test_two_who_ask_for_the_same_pairs_write_them_in_one_order(edition: Edition, pairs: Pairs) -> None:
    """Else each could wait for a row of the other's: they come in the order of the methods in an address."""
    assert ask(edition, visitor("192.0.2.1"), *reversed(pairs[:5]))
    written = Comparison.objects.order_by("pk").values_list("first", "second")
    assert list(written) == pairs[:5]
    noted = Question.objects.order_by("pk").values_list("comparison__first", "comparison__second")
    assert list(noted) == pairs[:5]


def test_visitors_cannot_take_the_places_of_those_who_are_signed_in(
    edition: Edition, pairs: Pairs, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(questions, "MAX_WAITING", 2)
    assert [ask(edition, visitor(f"{n}"), pairs[n]) for n in range(3)] == [True, True, False]
    assert ask(edition, questions.asker_of(user=owner, address="0"), pairs[3])


def test_no_address_is_stored_and_who_asked_is_forgotten_once_it_is_computed(
    entries: list[Submission], edition: Edition, client: Client
) -> None:
    m = "&m=".join(str(entry.method_id) for entry in entries[:2])
    client.get(f"/compare/?split=test&m={m}")
    [question] = Question.objects.all()
    assert len(question.asker) == 64
    assert "127.0.0.1" not in str(vars(question))
    assert question.asker == visitor("127.0.0.1").name != visitor("127.0.0.2").name
    builders.infer_all()
    assert not Question.objects.exists()
    assert Comparison.objects.exclude(computed_at=None).count() == 1


def test_who_asked_for_what_cannot_be_computed_is_forgotten_in_a_day(edition: Edition, pairs: Pairs) -> None:
    ask(edition, visitor("a"), pairs[0], ago_s=25 * 3600)
    ask(edition, visitor("b"), pairs[1])
    assert upkeep.clean(now=timezone.now()).n_questions == 1
    assert Question.objects.get().asker == visitor("b").name


def test_a_full_asker_is_told_on_the_page_and_in_the_api(
    entries: list[Submission], edition: Edition, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(questions, "MAX_PLACES", 1)
    m = "&m=".join(str(entry.method_id) for entry in entries[:3])
    for address in ("/compare/", "/api/v1/compare"):
        answer = client.get(f"{address}?split=test&m={m}")
        assert (answer.status_code, answer["Retry-After"]) == (429, "10")
        assert "You wait for 0 comparisons and have asked for 3 more" in answer.content.decode()
    assert answer.json()["code"] == "throttled"
    assert not Comparison.objects.exists()


def test_a_worker_looks_anew_whose_turn_it_is(
    entries: list[Submission], edition: Edition, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Within one go, in which it computes up to fifty."""
    ids = Evaluation.objects.filter(edition=edition).order_by("pk").values_list("pk", flat=True)
    some = list(itertools.combinations(ids, 2))
    for pair in some[:3]:
        ask(edition, visitor("flood"), pair, ago_s=5)
    done: list[tuple[Any, Any]] = []
    end = questions.end

    def note(row: Comparison) -> None:
        end(row)
        done.append((row.first_id, row.second_id))
        if len(done) == 1:
            ask(edition, visitor("new"), some[4])

    monkeypatch.setattr(questions, "end", note)
    builders.infer_all()
    assert done == [some[0], some[4], some[1], some[2]]
