"""Comparisons of methods."""

from uuid import UUID

from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter, OpenApiResponse, extend_schema
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard.api.authentication import require_split
from leaderboard.api.compare_serializers import ComparedSerializer
from leaderboard.api.exceptions import edition_number
from leaderboard.api.schema import errors, response_header
from leaderboard.api.views import current_split, published_edition
from leaderboard.ops import rate_limits
from leaderboard.scoring import comparisons

RETRY_AFTER_S = 2


class CompareView(APIView):
    """Methods of one board, compared pair by pair."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="compare",
        parameters=[
            OpenApiParameter("split", str, required=True, description="Name of the split."),
            OpenApiParameter("m", UUID, many=True, required=True, description="Ids of two to five methods."),
            OpenApiParameter(
                "edition", int, description="Number of a published edition; default: the current."
            ),
            response_header("Retry-After", int, "Seconds after which to ask for the rest.", statuses=[202]),
        ],
        responses={
            200: ComparedSerializer,
            202: OpenApiResponse(
                ComparedSerializer, "Partial: the rest is being computed; repeat after Retry-After seconds."
            ),
            **errors(400, 404, 429),
        },
    )
    def get(self, request: Request) -> Response:
        """Compare two to five methods: differences, confidence intervals and p-values; 202 until complete."""
        name, number = (request.query_params.get(key, "") for key in ("split", "edition"))
        require_split(request.auth, name)  # authentication does so for splits in the path alone
        split = current_split(request, name)
        found = comparisons.of(
            methods=[comparisons.method_id(text) for text in request.query_params.getlist("m")],
            split=split,
            viewer=request.user,
            now=timezone.now(),
            address=rate_limits.address_of(request),
            edition=published_edition(split, edition_number(number)) if number else None,
        )
        data = ComparedSerializer(found).data
        if found.is_complete:
            return Response(data)
        return Response(data, status=202, headers={"Retry-After": str(RETRY_AFTER_S)})
