"""Boards: the current one of each split, and that of every published edition."""

from datetime import datetime

from django.contrib.auth.models import AnonymousUser
from drf_spectacular.utils import OpenApiParameter, extend_schema
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard.api.schema import errors
from leaderboard.api.serializers import BoardSerializer
from leaderboard.api.throttling import AsOfThrottle
from leaderboard.api.views import current_split, published_edition
from leaderboard.boards import filters, listing, snapshots
from leaderboard.exports import tables
from leaderboard.models import Edition, Split

SORT = OpenApiParameter("sort", str, description="Name of a column; `-` before it: descending.")
AT = OpenApiParameter("at", str, description="The board as of this date or time.")
INTERVALS = OpenApiParameter(
    "intervals",
    str,
    enum=list(tables.WITH_INTERVALS),
    description="Whether to include the 95% confidence interval of each score.",
)
MINE = OpenApiParameter(
    "mine",
    str,
    enum=list(tables.WITH_INTERVALS),
    description="`0` or `no`: the public board, without your team's private rows.",
)
FILTERS = [
    OpenApiParameter(name, str, description=f"{each.label}: {each.kind.takes}.")
    for name, each in filters.FILTERS.items()
]


def _board(
    request: Request, *, split: Split, edition: Edition | None = None, at: datetime | None = None
) -> Response:
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
    context = {"has_intervals": has_intervals, "explained_by": board.edition}
    return Response(BoardSerializer(board, context=context).data)


class BoardView(APIView):
    permission_classes = [AllowAny]
    throttle_classes = [*APIView.throttle_classes, AsOfThrottle]

    @extend_schema(
        operation_id="board",
        parameters=[SORT, AT, INTERVALS, MINE, *FILTERS],
        responses={200: BoardSerializer, **errors(400, 404)},
    )
    def get(self, request: Request, split: str) -> Response:
        """Submissions and quoted rows, ranked by the first of the scores; filters do not change the ranks."""
        query = request.query_params
        at = listing.parse_time(query["at"]) if query.get("at") else None
        return _board(request, split=current_split(request, split), at=at)


class EditionBoardView(APIView):
    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="edition_board",
        parameters=[SORT, INTERVALS, MINE, *FILTERS],
        responses={200: BoardSerializer, **errors(400, 404)},
    )
    def get(self, request: Request, split: str, number: int) -> Response:
        """Submissions and quoted rows as this edition ranks them."""
        edition = published_edition(split, number)
        return _board(request, split=edition.split, edition=edition)
