"""Boards over the API: the present one of a split, and that of every published edition."""

from django.http import Http404
from django.shortcuts import get_object_or_404
from drf_spectacular.utils import OpenApiParameter, extend_schema
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard import exports, filters, snapshots, standings
from leaderboard.api.serializers import BoardSerializer, ErrorSerializer
from leaderboard.keeping import NEVER, one_of

SORT = OpenApiParameter("sort", str, description="A column's name; '-' before it reverses.")
AT = OpenApiParameter("at", str, description="A date or time: the board as it stood then.")
RESPONSES = {
    200: BoardSerializer,
    (400, "application/problem+json"): ErrorSerializer,
    (404, "application/problem+json"): ErrorSerializer,
}
_MEANINGS = {
    "frames": "Only methods that use so many frames, 2 to 6.",
    "cameras": "Only methods that take `one` view of a scene, or `several`.",
    "boxes": "Only methods whose boxes are `given`, `detected`, or `none`.",
    "nerf": "Only methods that use NeRF data (`yes`) or do not (`no`).",
    "extra": "Only methods that use extra data (`yes`) or do not (`no`).",
    "code": "Only methods with code (`yes`) or without (`no`).",
    "paper": "Only methods with a paper (`yes`) or without (`no`).",
    "pretraining": "Only methods with this text in what is said of their pretraining; case is ignored.",
    "parameters": "Only methods with at most so many parameters: a number, or as `25M` with k, M or B (10⁹).",
    "latency": "Only methods that take at most so many milliseconds.",
    "hardware": "Only methods with this text in what their latency was measured on; case is ignored.",
    "q": "Only rows with this text in the name of the method or the team.",
}
INTERVALS = OpenApiParameter(
    "intervals",
    str,
    enum=list(exports.WITH_INTERVALS),
    description="Whether to include the 95 % confidence interval of each value.",
)
PARAMETERS = {
    "sort": one_of(*standings.SORTS),
    "at": NEVER,
    "intervals": exports.YES_OR_NO,
    **filters.PARAMETERS,
}
FILTERS = [OpenApiParameter(name, str, description=_MEANINGS[name]) for name in filters.NAMES]


def _context(request: Request) -> dict[str, bool]:
    """What of a row is asked for."""
    return {"has_intervals": exports.has_intervals(request.query_params.get("intervals", ""))}


class BoardView(APIView):
    """The board of a split."""

    permission_classes = [AllowAny]

    @extend_schema(operation_id="board", parameters=[SORT, AT, INTERVALS, *FILTERS], responses=RESPONSES)
    def get(self, request: Request, split: str) -> Response:
        """Submissions and published rows, ranked by published MiD; filters leave the ranks as they are."""
        found = next((row for row in snapshots.splits() if row.pk == split), None)
        if found is None:
            raise Http404
        query = request.query_params
        board = snapshots.board(
            split=found,
            viewer=request.user,
            sort=query.get("sort", "rank"),
            at=standings.parse_moment(query["at"]) if query.get("at") else None,
            filters=filters.parse(query.dict()),
        )
        return Response(BoardSerializer(board, context=_context(request)).data)


class EditionBoardView(APIView):
    """The board of one edition, for ever."""

    permission_classes = [AllowAny]

    @extend_schema(operation_id="edition_board", parameters=[SORT, INTERVALS, *FILTERS], responses=RESPONSES)
    def get(self, request: Request, split: str, number: int) -> Response:
        """Submissions and published rows as that edition ranks them."""
        edition = get_object_or_404(snapshots.editions(), split=split, number=number)
        board = snapshots.board(
            split=edition.split,
            edition=edition,
            viewer=request.user,
            sort=request.query_params.get("sort", "rank"),
            filters=filters.parse(request.query_params.dict()),
        )
        return Response(BoardSerializer(board, context=_context(request)).data)
