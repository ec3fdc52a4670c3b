"""Open, publish, roll back, give up: each behind a page, each one verb, each with a reason."""

import pytest
from django.test import Client

from evaluator import PROTOCOLS
from leaderboard.models import (
    AuditEvent,
    Edition,
    Evaluation,
    GroundTruth,
    Publication,
    Status,
    Submission,
    User,
)
from tests import builders, pages
from tests.editions import publish
from tests.leaderboard.web.maintain.desk import (
    HUB,
    OPEN,
    SECOND,
    board_number,
    effects,
    get,
    main_text,
    refusal,
)
from tests.leaderboard.web.test_every_page import assert_sound

pytestmark = pytest.mark.slow

# --- open ------------------------------------------------------------------------------------------------


def test_edition_is_opened_with_an_imported_truth_and_a_protocol(
    keeper: Client, entries: list[Submission], edition: Edition, maintainer: User
) -> None:
    response = keeper.post(OPEN, {"digest": edition.ground_truth_id, "protocol": "toolkit"})
    assert response.headers["Location"] == SECOND
    opened = Edition.objects.get(number=2)
    assert (opened.ground_truth, opened.protocol) == (edition.ground_truth, "toolkit")
    assert opened.opened_by == maintainer
    assert Evaluation.objects.filter(edition=opened, status=Status.QUEUED).count() == 4


def test_opening_says_that_values_are_never_uploaded(keeper: Client, rescored: Edition) -> None:
    root = get(keeper, OPEN)
    assert "You cannot upload ground truth here" in root.one("main").text
    assert "tsttc-maintain open_edition test --truth PATH" in root.one("pre").text
    assert root.all("input", type="file") == []
    offered = [field.attributes["value"] for field in root.all("input", type="radio", name="digest")]
    assert set(offered) == set(GroundTruth.objects.values_list("pk", flat=True))
    assert len(offered) == 2


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, "and is the current board already."),
        ({"digest": "sha256:0"}, "That ground truth is not this split's"),
        ({"digest": ""}, "No ground truth was chosen"),
        ({"protocol": "mine"}, f"There is no such protocol; expected one of {', '.join(PROTOCOLS)}."),
        ({"protocol": "tsttc-2"}, "is hidden, and protocol 'tsttc-2' would tell more of it (Warning error)"),
    ],
)
def test_what_cannot_be_opened_is_refused_in_a_sentence(
    keeper: Client, edition: Edition, change: dict[str, str], words: str
) -> None:
    data = {"digest": edition.ground_truth_id, "protocol": "tsttc-1", **change}
    response = keeper.post(OPEN, data)
    assert response.status_code == 422
    assert words in assert_sound(response).one("main").text
    assert Edition.objects.count() == 1


# --- publish, roll back, give up ----------------------------------------------------------------------------


def test_publishing_repeats_the_consequences_and_carries_what_was_compared(
    keeper: Client, rescored: Edition
) -> None:
    root = get(keeper, f"{SECOND}publish/")
    assert root.one("input", name="replaces").attributes["value"] == "1"
    assert root.all("input", type="checkbox") == []
    sentences = effects(get(keeper, SECOND))
    assert effects(root)[: len(sentences)] == sentences
    assert sentences[0] == "Ground truth: 5 labels corrected."
    assert "Edition 2 replaces edition 1 on the Test board." in root.one("main").text


def test_publishing_makes_it_the_board_with_the_reason(
    keeper: Client, rescored: Edition, maintainer: User
) -> None:
    response = keeper.post(
        f"{SECOND}publish/", {"reason": " Five labels\nwere wrong. ", "replaces": 1}, follow=True
    )
    assert response.redirect_chain == [("/board/test/", 302)]
    root = assert_sound(response)
    assert "Edition 2 is now the Test board." in root.one("div", class_="messages").text
    assert "edition 2 (5 labels corrected)" in root.one("p", class_="facts").text
    publication = Publication.objects.first()
    assert publication is not None
    assert (publication.reason, publication.by) == ("Five labels were wrong.", maintainer)
    assert "Five labels were wrong." in main_text(keeper, "/board/test/editions/")


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"replaces": 1}, "Nothing was changed: see the field marked below."),
        ({"replaces": 7, "reason": "x"}, "The current edition of 'test' is 1, no longer 7"),
        ({"replaces": "one", "reason": "x"}, "reload the page"),
    ],
)
def test_what_the_form_lacks_is_named_and_nothing_changes(
    keeper: Client, rescored: Edition, data: dict[str, object], words: str
) -> None:
    assert words in refusal(keeper, f"{SECOND}publish/", data)


def test_unfinished_submissions_are_listed_and_left_out_only_knowingly(
    keeper: Client, second: Edition
) -> None:
    root = get(keeper, f"{SECOND}publish/")
    listed = [li.one("a").text for li in root.one("ul", class_="left-out").all("li")]
    assert sorted(listed) == ["M1.05", "M1.1", "M1.2", "M1.4"]
    assert "checked" not in root.one("input", name="leave_out").attributes
    data = {"reason": "x", "replaces": 1}
    sentence = refusal(keeper, f"{SECOND}publish/", data)
    assert "4 submissions are neither scored nor rejected" in sentence
    assert keeper.post(f"{SECOND}publish/", {**data, "leave_out": "on"}).status_code == 302
    assert board_number() == 2
    history = main_text(keeper, "/board/test/editions/")
    assert "Without 4 submissions that were not finished or no longer accepted." in history


def test_rolling_back_returns_the_board_as_it_was(
    keeper: Client, entries: list[Submission], rescored: Edition
) -> None:
    before = pages.board_rows(pages.page(keeper.get("/board/test/")))
    publish(rescored)
    root = get(keeper, f"{SECOND}roll-back/")
    assert "becomes the current board again; this undoes: 5 labels corrected." in root.one("main").text
    assert root.one("input", name="replaces").attributes["value"] == "2"
    response = keeper.post(f"{SECOND}roll-back/", {"reason": "A mistake.", "replaces": 2}, follow=True)
    assert pages.board_rows(pages.page(response)) == before
    message = pages.page(response).one("div", class_="messages").text
    assert message == "Edition 2 was rolled back: the Test board is the one before it."
    assert "Rolled back from edition 2 to edition 1. A mistake." in main_text(keeper, "/board/test/editions/")


def test_giving_up_ends_a_preparation_and_its_work(keeper: Client, second: Edition, maintainer: User) -> None:
    assert "4 queued evaluations are cancelled" in main_text(keeper, f"{SECOND}discard/")
    data = {"reason": "The wrong file."}
    unsure = keeper.post(f"{SECOND}discard/", data)
    assert (unsure.status_code, AuditEvent.objects.filter(verb="discarded").count()) == (422, 0)
    assert "tick the box" in assert_sound(unsure).one("div", class_="wrong").text
    response = keeper.post(f"{SECOND}discard/", {**data, "confirm": "on"}, follow=True)
    assert response.redirect_chain == [(HUB, 302)]
    assert "Compare and decide" not in assert_sound(response).one("main").text
    event = AuditEvent.objects.filter(verb="discarded").get()
    assert (event.actor, event.details["reason"]) == (maintainer, "The wrong file.")
    assert builders.score_all() == 0
    assert "discarded" in main_text(keeper, SECOND)
    assert "Publish" not in main_text(keeper, SECOND)
    assert "was discarded" in refusal(keeper, f"{SECOND}publish/", {"reason": "x", "replaces": 1})
