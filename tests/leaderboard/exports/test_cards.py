"""Cards: the pictures of boards and methods that links show."""

import random
import threading
from io import BytesIO

import pytest
from django.test import Client
from django.utils import timezone
from PIL import Image

from leaderboard.exports import card_drawing, cards
from leaderboard.exports.cards import Card, CardRow
from leaderboard.models import CardPicture, Edition, Method, Submission, User
from leaderboard.scoring import worker
from leaderboard.workers import queue, upkeep
from tests import builders, pages

FALLBACK = "/static/card.jpg"


@pytest.fixture
def sent(edition: Edition, owner: User) -> Submission:
    found = builders.submit(owner, builders.predictions(edition), method="Foo")
    builders.score_all()
    return found


def addresses(sent: Submission) -> tuple[str, str]:
    return "/board/test/card.png", f"/methods/{sent.method_id}/card.png"


def test_a_card_is_a_small_picture_of_the_size_that_others_show() -> None:
    drawn = card_drawing.png(Card("Test board", "2 results", (CardRow("1", "Łódź β Сеть", "MiD 3.1"),)))
    assert Image.open(BytesIO(drawn)).size == (1200, 630)
    assert len(drawn) < 50_000


def test_any_length_of_name_fits() -> None:
    long = "N" * 80
    assert card_drawing.png(Card(long, f"by {long}", (CardRow("Rank 123", long, "MiD 123.45 (1.00–2.00)"),)))


def test_a_name_that_the_font_cannot_write_has_no_card_of_its_own() -> None:
    assert card_drawing.png(Card("接触时间", "by Owls", ())) == b""


@pytest.mark.slow
def test_a_worker_draws_each_card_once_and_pages_show_it(sent: Submission, client: Client) -> None:
    for address in addresses(sent):
        assert client.get(address)["Location"] == FALLBACK
    assert upkeep.draw(now=timezone.now()) == 4  # three boards and a method
    assert upkeep.draw(now=timezone.now()) == 0
    for address in addresses(sent):
        answer = client.get(address)
        assert (answer.status_code, answer["Content-Type"]) == (200, "image/png")
        assert answer["Cross-Origin-Resource-Policy"] == "cross-origin"
        assert client.get(address, headers={"If-None-Match": answer["ETag"]}).status_code == 304
        page = pages.get(client, address.removesuffix("card.png"))
        assert page.one("meta", property="og:image").attributes["content"].endswith(address)


def test_cards_tell_what_the_board_tells(sent: Submission) -> None:
    found = {card.title: card for card in cards.present().values()}
    board, method = found["Test board"], found["Foo"]
    assert board.subtitle.endswith("edition 1")
    assert all(row.value.startswith("MiD ") for row in board.rows)
    assert method.subtitle == "by Owls"
    assert method.rows[0].name.endswith("on Test")


@pytest.mark.parametrize("seen", ["PRIVATE", "ANONYMOUS"])
def test_no_card_names_a_method_that_is_private_or_anonymous(
    edition: Edition, owner: User, client: Client, seen: str
) -> None:
    hidden = builders.submit(owner, builders.predictions(edition), method="Secret", visibility=seen)
    builders.score_all()
    words = repr(list(cards.present().values()))
    assert "Secret" not in words
    assert "Owls" not in words
    answer = client.get(f"/methods/{hidden.method_id}/card.png")
    assert answer.status_code == (404 if seen == "PRIVATE" else 302)


@pytest.mark.slow
def test_a_card_that_no_longer_holds_is_shown_to_nobody_and_removed(sent: Submission, client: Client) -> None:
    upkeep.draw(now=timezone.now())
    before = set(CardPicture.objects.values_list("digest", flat=True))
    Method.objects.update(name="Bar")
    builders.board_changed("test")
    assert client.get(addresses(sent)[1])["Location"] == FALLBACK
    upkeep.draw(now=timezone.now())
    after = set(CardPicture.objects.values_list("digest", flat=True))
    assert before - after
    assert after == set(cards.present())
    assert client.get(addresses(sent)[1]).status_code == 200


def test_a_card_that_cannot_be_drawn_is_not_tried_again(
    edition: Edition, owner: User, client: Client
) -> None:
    sent = builders.submit(owner, builders.predictions(edition), method="接触时间")
    builders.score_all()
    upkeep.draw(now=timezone.now())
    assert upkeep.draw(now=timezone.now()) == 0
    assert client.get(addresses(sent)[1])["Location"] == FALLBACK


def test_of_many_workers_one_draws_when_it_is_time(sent: Submission) -> None:
    for _ in range(3):
        queue.draw_cards_if_due(rng=random.Random(0), stopping=threading.Event())
    assert CardPicture.objects.count() == 4
    CardPicture.objects.all().delete()
    queue.draw_cards_if_due(rng=random.Random(0), stopping=threading.Event())
    assert CardPicture.objects.count() == 0, "a moment ago somebody looked"


def test_a_worker_that_is_to_stop_draws_no_further_card(sent: Submission) -> None:
    assert upkeep.draw(now=timezone.now(), is_stopping=lambda: True) == 0


def test_cards_wait_while_this_process_decides_a_submission(sent: Submission) -> None:
    asked: list[bool] = []

    def is_stopping() -> bool:
        asked.append(True)
        return len(asked) > 3

    with worker._in_hand:
        assert upkeep.draw(now=timezone.now(), is_stopping=is_stopping) == 0
    assert upkeep.draw(now=timezone.now()) > 0
