"""Boards: the current one of each split, and that of every published edition.

Their JSON is written row by row: one of ten thousand rows is never in memory as a whole.
"""

from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime
from typing import Any, Final

from django.contrib.auth.models import AnonymousUser
from django.http import HttpResponse, HttpResponseBase, StreamingHttpResponse
from drf_spectacular.utils import OpenApiParameter, extend_schema
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.views import APIView

from leaderboard.api.parsers import UniformJSONRenderer
from leaderboard.api.schema import errors
from leaderboard.api.serializers import BoardSerializer, EntrySerializer
from leaderboard.api.throttling import AsOfThrottle
from leaderboard.api.views import current_split, published_edition
from leaderboard.boards import boards, filters, snapshots
from leaderboard.boards.boards import Board
from leaderboard.exports import tables
from leaderboard.http import A_PAST_DAY, one_of
from leaderboard.models import Edition, Split

# Rows: what a board of so many says is about a megabyte.
MAX_WHOLE: Final = 1500
ROWS_AT_ONCE: Final = 100
_END: Final = b"]}"
SORT = OpenApiParameter("sort", str, description="Name of a column; `-` before it: descending.")
AT = OpenApiParameter("at", str, description="The board as of this date or time.")
INTERVALS = OpenApiParameter(
    "intervals",
    str,
    enum=list(tables.WITH_INTERVALS),
    description="Whether to include the 95 % confidence interval of each score.",
)
MINE = OpenApiParameter(
    "mine",
    str,
    enum=list(tables.WITH_INTERVALS),
    description="`0` or `no`: the public board, without the rows that only your team sees.",
)
PARAMETERS = {
    "sort": one_of(*boards.SORTS),
    "at": A_PAST_DAY,
    "intervals": tables.YES_OR_NO,
    "mine": tables.YES_OR_NO,
    **filters.PARAMETERS,
}
FILTERS = [
    OpenApiParameter(name, str, description=f"{each.label}: {each.kind.takes}.")
    for name, each in filters.FILTERS.items()
]


def _board(
    request: Request, *, split: Split, edition: Edition | None = None, at: datetime | None = None
) -> HttpResponseBase:
    query = request.query_params
    mine = query.get("mine", "")
    has_own = not mine or tables.is_asked_for("mine", mine)
    board = snapshots.board(
        split=split,
        edition=edition,
        viewer=request.user if has_own else AnonymousUser(),
        sort=query.get("sort", "rank"),
        at=at,
        filters=filters.parse(query.dict()),
    )
    has_intervals = tables.is_asked_for("intervals", query.get("intervals", ""))
    document = pieces(board, has_intervals=has_intervals)
    # What the page cache takes in piece by piece. Of what is one reader's alone, the ETag needs the whole.
    is_whole = len(board.entries) <= MAX_WHOLE or request.user.is_authenticated
    kind = HttpResponse if is_whole else StreamingHttpResponse
    return kind(document, content_type=UniformJSONRenderer.media_type)


class BoardView(APIView):
    """The board of a split."""

    permission_classes = [AllowAny]
    throttle_classes = [*APIView.throttle_classes, AsOfThrottle]

    @extend_schema(
        operation_id="board",
        parameters=[SORT, AT, INTERVALS, MINE, *FILTERS],
        responses={200: BoardSerializer, **errors(400, 404)},
    )
    def get(self, request: Request, split: str) -> HttpResponseBase:
        """Submissions and quoted rows, ranked by published MiD; filters do not change the ranks."""
        query = request.query_params
        at = boards.parse_time(query["at"]) if query.get("at") else None
        return _board(request, split=current_split(request, split), at=at)


class EditionBoardView(APIView):
    """The permanent board of one edition."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="edition_board",
        parameters=[SORT, INTERVALS, MINE, *FILTERS],
        responses={200: BoardSerializer, **errors(400, 404)},
    )
    def get(self, request: Request, split: str, number: int) -> HttpResponseBase:
        """Submissions and quoted rows as this edition ranks them."""
        edition = published_edition(split, number)
        return _board(request, split=edition.split, edition=edition)


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
