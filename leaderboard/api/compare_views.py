"""Comparisons over the API."""

from uuid import UUID

from django.http import Http404
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter, OpenApiResponse, extend_schema
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard import comparisons, rates, snapshots
from leaderboard.api.authentication import require_split
from leaderboard.api.compare_shapes import ComparedSerializer
from leaderboard.api.problems import edition_number
from leaderboard.api.serializers import ErrorSerializer
from leaderboard.models import Split

RETRY_AFTER_S = 2


class CompareView(APIView):
    """Methods of one board, compared pair by pair."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="compare",
        parameters=[
            OpenApiParameter("split", str, required=True, description="Name of the split."),
            OpenApiParameter("m", UUID, many=True, required=True, description="Ids of two to five methods."),
            OpenApiParameter("edition", int, description="Number of a published edition; else the board's."),
            OpenApiParameter(
                "Retry-After",
                int,
                OpenApiParameter.HEADER,
                description="Seconds until it is worth asking for the rest.",
                response=[202],
            ),
        ],
        responses={
            200: ComparedSerializer,
            202: OpenApiResponse(
                ComparedSerializer, "What is known; the rest is being computed: ask again after Retry-After."
            ),
            (400, "application/problem+json"): ErrorSerializer,
            (404, "application/problem+json"): ErrorSerializer,
            (429, "application/problem+json"): ErrorSerializer,
        },
    )
    def get(self, request: Request) -> Response:
        """Compare two to five methods: differences, confidence intervals and p; 202 until all are there."""
        query = request.query_params
        split = _split(request, query.get("split", ""))
        number = query.get("edition")
        editions = snapshots.editions()
        found = comparisons.of(
            methods=[_method_id(text) for text in query.getlist("m")],
            split=split,
            viewer=request.user,
            now=timezone.now(),
            address=rates.address_of(request),
            edition=get_object_or_404(editions, split=split, number=edition_number(number))
            if number
            else None,
        )
        headers = {} if found.is_complete else {"Retry-After": str(RETRY_AFTER_S)}
        status = 200 if found.is_complete else 202
        return Response(ComparedSerializer(found).data, status=status, headers=headers)


def _split(request: Request, name: str) -> Split:
    """The split of that name, which no address names: a token's limit is looked at here."""
    require_split(request.auth, name)
    found = next((split for split in snapshots.splits() if split.pk == name), None)
    if found is None:
        raise Http404
    return found


def _method_id(text: str) -> UUID:
    try:
        return UUID(text)
    except ValueError:
        raise comparisons.UnknownMethod(
            f"There is no method {text[:60]!r}; expected an identifier as in the address of a method's page."
        ) from None
