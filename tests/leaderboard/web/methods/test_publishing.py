"""Open, publish, roll back, give up: each behind a page, each one verb, each with a reason."""

import pytest
from django.test import Client

from leaderboard.api import exceptions
from leaderboard.editions import corrections
from leaderboard.errors.refusals import NotMaintainer, Refused
from leaderboard.models import (
    AuditEvent,
    Edition,
    Evaluation,
    GroundTruth,
    Method,
    Publication,
    Status,
    Submission,
    User,
)
from tests import builders, pages
from tests.editions import open_edition, publish, roll_back
from tests.leaderboard.web.maintain.desk import (
    FIRST,
    HUB,
    OPEN,
    SECOND,
    board_number,
    get,
    refusal,
    said,
    totals,
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
    assert "python manage.py open_edition test --truth PATH" in root.one("pre").text
    assert root.all("input", type="file") == []
    offered = [field.attributes["value"] for field in root.all("input", type="radio", name="digest")]
    assert set(offered) == set(GroundTruth.objects.values_list("pk", flat=True))
    assert len(offered) == 2


def test_opening_what_exists_goes_on_with_it(keeper: Client, second: Edition) -> None:
    response = keeper.post(OPEN, {"digest": second.ground_truth_id, "protocol": "tsttc-1"})
    assert response.headers["Location"] == SECOND
    assert Evaluation.objects.filter(edition=second).count() == 4


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {},
            "test edition 1 has this ground truth, protocol and number of decimals (1), and is the "
            "current board already.",
        ),
        ({"digest": "sha256:0"}, "That ground truth is not this split's"),
        ({"digest": ""}, "No ground truth was chosen"),
        ({"protocol": "mine"}, "There is no such protocol; expected one of tsttc-1, toolkit."),
        ({"protocol": ""}, "No protocol was chosen"),
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


def test_split_without_truth_says_where_it_is_read(keeper: Client, edition: Edition) -> None:
    for answer in (keeper.get("/maintain/val/open/"), keeper.post("/maintain/val/open/")):
        assert "python manage.py import_truth val PATH" in assert_sound(answer).one("pre").text


# --- publish, roll back, give up ----------------------------------------------------------------------------


def test_publishing_repeats_the_consequences_and_carries_what_was_compared(
    keeper: Client, rescored: Edition
) -> None:
    root = get(keeper, f"{SECOND}publish/")
    assert root.one("input", name="replaces").attributes["value"] == "1"
    assert root.all("input", type="checkbox") == []
    assert totals(root) == totals(get(keeper, SECOND))
    assert "replaces edition 1 on the board: 5 labels corrected" in root.one("main").text


def test_publishing_makes_it_the_board_with_the_reason(
    keeper: Client, rescored: Edition, maintainer: User
) -> None:
    response = keeper.post(
        f"{SECOND}publish/", {"reason": " Five labels\nwere wrong. ", "replaces": 1}, follow=True
    )
    assert response.redirect_chain == [("/board/test/", 302)]
    root = assert_sound(response)
    assert "Edition 2 is now the board of test." in root.one("div", class_="messages").text
    assert "edition 2, 5 labels corrected" in root.one("p", class_="facts").text
    publication = Publication.objects.first()
    assert publication is not None
    assert (publication.reason, publication.by) == ("Five labels were wrong.", maintainer)
    assert "Five labels were wrong." in said(keeper, "/board/test/editions/")


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"replaces": 1}, "Nothing was changed: see the field marked below."),
        ({"replaces": 1, "reason": "  \n "}, "Nothing was changed: see the field marked below."),
        ({"replaces": 7, "reason": "x"}, "The current edition of 'test' is 1, no longer 7"),
        ({"reason": "x"}, "reload the page"),
        ({"replaces": "one", "reason": "x"}, "reload the page"),
        ({"replaces": 1, "reason": "x" * 1001}, "Nothing was changed: see the field marked below."),
    ],
)
@pytest.mark.parametrize("verb", ["publish", "roll-back"])
def test_what_the_form_lacks_is_said_and_nothing_changes(
    keeper: Client, rescored: Edition, verb: str, data: dict[str, object], words: str
) -> None:
    if verb == "roll-back":
        open_edition(None, protocol="toolkit")
        builders.score_all()
        publish(Edition.objects.get(number=3))
        data = {**data, **({"replaces": 3} if data.get("replaces") == 1 else {})}
        words = words.replace("is 1,", "is 3,")
    number = board_number()
    address = f"/maintain/test/editions/{number if verb == 'roll-back' else 2}/{verb}/"
    assert words in refusal(keeper, address, data)


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
    assert "4 submissions were left out." in said(keeper, "/board/test/editions/")


def test_second_click_on_publish_is_refused_in_a_sentence(keeper: Client, rescored: Edition) -> None:
    data = {"reason": "x", "replaces": 1}
    assert keeper.post(f"{SECOND}publish/", data).status_code == 302
    assert "is the current board already" in refusal(keeper, f"{SECOND}publish/", data)


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
    assert "Rolled back from edition 2 to edition 1. A mistake." in said(keeper, "/board/test/editions/")


def test_only_the_board_can_be_rolled_back_and_only_to_another(keeper: Client, rescored: Edition) -> None:
    assert "replaced no edition" in said(keeper, f"{FIRST}roll-back/")
    assert "is not the current edition of test" in said(keeper, f"{SECOND}roll-back/")
    data = {"reason": "x"}
    assert "replaced no edition" in refusal(keeper, f"{FIRST}roll-back/", {**data, "replaces": 1})
    assert "no longer 2" in refusal(keeper, f"{SECOND}roll-back/", {**data, "replaces": 2})


def test_edition_that_was_taken_back_can_be_published_again(keeper: Client, rescored: Edition) -> None:
    publish(rescored)
    roll_back()
    assert "Publish again…" in said(keeper, SECOND)
    assert "Discard" not in said(keeper, SECOND)
    assert keeper.post(f"{SECOND}publish/", {"reason": "After all.", "replaces": 1}).status_code == 302
    assert board_number() == 2


def test_giving_up_ends_a_preparation_and_its_work(keeper: Client, second: Edition, maintainer: User) -> None:
    assert "4 queued evaluations are cancelled" in said(keeper, f"{SECOND}discard/")
    response = keeper.post(f"{SECOND}discard/", {"reason": "The wrong file."}, follow=True)
    assert response.redirect_chain == [(HUB, 302)]
    assert "No draft edition." in assert_sound(response).one("main").text
    event = AuditEvent.objects.filter(verb="discarded").get()
    assert (event.actor, event.details["reason"]) == (maintainer, "The wrong file.")
    assert builders.score_all() == 0
    assert "discarded" in said(keeper, SECOND)
    assert "Publish" not in said(keeper, SECOND)
    assert "was discarded" in refusal(keeper, f"{SECOND}publish/", {"reason": "x", "replaces": 1})


def test_what_was_published_cannot_be_given_up(keeper: Client, rescored: Edition) -> None:
    assert "is not in preparation" in refusal(keeper, f"{FIRST}discard/", {"reason": "x"})
    assert "No reason was given" in assert_sound(keeper.post(f"{SECOND}discard/")).one("main").text


@pytest.mark.parametrize("verb", ["publish", "discard"])
def test_maintainer_who_is_none_any_more_is_refused_by_the_verb_as_well(
    keeper: Client, rescored: Edition, monkeypatch: pytest.MonkeyPatch, verb: str
) -> None:
    def dismissed(**_: object) -> None:
        raise NotMaintainer

    monkeypatch.setattr(corrections, verb, dismissed)
    response = keeper.post(f"{SECOND}{verb}/", {"reason": "x", "replaces": 1})
    assert response.status_code == 404


def test_texts_of_others_are_never_markup(keeper: Client, rescored: Edition) -> None:
    Method.objects.filter(name="M1.05").update(name="<script>alert(1)</script>")
    publish(rescored)
    for address in (HUB, SECOND, FIRST, f"{FIRST}publish/", f"{SECOND}roll-back/"):
        assert get(keeper, address).one("main").all("script") == []


# --- the API in the same words -----------------------------------------------------------------------------


def test_refused_edition_is_a_conflict_for_programs_and_nobody_else_a_maintainer() -> None:
    refused = exceptions.exception_handler(Refused("edition-refused", "It cannot be."), {})
    assert refused is not None
    assert refused.data is not None
    assert (refused.status_code, refused.data["detail"]) == (409, "It cannot be.")
    stranger = exceptions.exception_handler(NotMaintainer("Only maintainers may."), {})
    assert stranger is not None
    assert stranger.data is not None
    assert (stranger.status_code, stranger.data["code"]) == (403, "not-maintainer")
