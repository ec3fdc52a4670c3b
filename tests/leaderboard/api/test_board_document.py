"""The JSON of a board is written in pieces, and is what its serializer says."""

from dataclasses import replace

import pytest
from django.contrib.auth.models import AnonymousUser
from django.http import StreamingHttpResponse
from django.test import Client

from leaderboard.api import board_views
from leaderboard.api.parsers import UniformJSONRenderer
from leaderboard.api.serializers import BoardSerializer
from leaderboard.boards import boards, snapshots
from leaderboard.models import Edition, Method, User
from leaderboard.web.middleware import page_cache
from leaderboard.web.middleware.page_cache import memory
from tests import board_rows

pytestmark = pytest.mark.slow

API = "/api/v1/splits/test/board"


@pytest.fixture
def filled(edition: Edition, owner: User) -> list[Method]:
    memory.clear()
    return board_rows.fill(edition, n=5, user=owner)


@pytest.mark.parametrize("rows_at_once", [2, 100])
def test_the_pieces_are_the_bytes_of_the_whole(
    filled: list[Method], edition: Edition, rows_at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(board_views, "ROWS_AT_ONCE", rows_at_once)
    full = boards.board(split=edition.split, viewer=AnonymousUser())
    odd = replace(full.entries[0], description='"]}\u2028\\ \x00 é 🙂', team="], [")
    for entries in ((), full.entries[:1], (odd, *full.entries), (*full.entries, odd)):
        board = replace(full, entries=entries)
        for has_intervals in (False, True):
            told = BoardSerializer(board, context={"has_intervals": has_intervals}).data
            pieces = list(board_views.pieces(board, has_intervals=has_intervals))
            assert b"".join(pieces) == UniformJSONRenderer().render(told)


def test_a_large_board_is_the_same_answer_in_less_memory(
    filled: list[Method], client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    forms: tuple[dict[str, str], ...] = ({}, {"Accept-Encoding": "gzip"})
    small = [client.get(API, headers=form) for form in forms]
    memory.clear()
    monkeypatch.setattr(board_views, "MAX_WHOLE", 2)
    monkeypatch.setattr(page_cache, "MAX_WHOLE_BYTES", 1000)
    monkeypatch.setattr(page_cache, "PIECE_BYTES", 100)
    for _ in ("first", "from memory", "past every layer"):
        for form, wanted in zip(forms, small, strict=True):
            found = client.get(API, headers=form)
            assert b"".join(found) == wanted.content
            for name in ("ETag", "Content-Type", "Content-Length", "Vary", "Cache-Control"):
                assert found[name] == wanted[name]
            again = client.get(API, headers=form | {"If-None-Match": wanted["ETag"]})
            assert again.status_code == 304
        assert client.head(API)["Content-Length"] == str(len(small[0].content))
    kept = memory.get(API)
    assert kept is not None
    assert kept[1].body is None
    assert isinstance(client.get(API), StreamingHttpResponse)


def test_a_reader_who_signs_in_is_told_the_etag_of_a_large_board(
    filled: list[Method], client: Client, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(board_views, "MAX_WHOLE", 2)
    client.force_login(owner)
    tag = client.get(API)["ETag"]
    assert client.get(API, headers={"If-None-Match": tag}).status_code == 304


def test_a_board_read_in_parts_is_the_board(
    filled: list[Method], edition: Edition, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = boards.public_rows(split=edition.split, edition=edition)
    for size in (1, 2, 5):
        monkeypatch.setattr("leaderboard.db.bulk.in_parts.__kwdefaults__", {"size": size})
        assert boards.public_rows(split=edition.split, edition=edition) == whole


def test_of_one_edition_a_process_knows_one_snapshot(filled: list[Method], edition: Edition) -> None:
    snapshots.snapshot_cache.clear()
    first = snapshots.draw(edition)
    (split,) = (each for each in snapshots.splits() if each.pk == edition.split_id)
    assert snapshots.shown(split=split, edition=edition) is first
    Method.objects.filter(pk=filled[0].pk).update(name="Another name")
    second = snapshots.draw(edition)
    assert (len(snapshots.snapshot_cache), second == first) == (1, False)
