"""The JSON of a board, written row by row: one of ten thousand rows is never in memory as a whole."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

from leaderboard.api.parsers import UniformJSONRenderer
from leaderboard.api.serializers import BoardSerializer, EntrySerializer
from leaderboard.boards.boards import Board

ROWS_AT_ONCE: Final = 100
_END: Final = b"]}"


def pieces(board: Board, *, has_intervals: bool) -> Iterator[bytes]:
    """The document in pieces: what `BoardSerializer` says, byte for byte."""
    context = {"has_intervals": has_intervals}
    # Its rows are its last field.
    frame = _rendered(BoardSerializer(replace(board, entries=()), context=context).data)
    yield frame.removesuffix(_END)
    told = EntrySerializer(context=context)
    for first in range(0, len(board.entries), ROWS_AT_ONCE):
        rows = [told.to_representation(entry) for entry in board.entries[first : first + ROWS_AT_ONCE]]
        yield (b"," if first else b"") + _rendered(rows)[1:-1]
    yield _END


def _rendered(data: Any) -> bytes:
    written: bytes = UniformJSONRenderer().render(data)
    return written
