"""Score receipts over the API: for the submission's own team."""

from typing import cast

from django.shortcuts import get_object_or_404
from drf_spectacular.utils import OpenApiParameter, extend_schema
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard import receipts
from leaderboard.api.problems import edition_number
from leaderboard.api.receipt_shapes import ReceiptSerializer
from leaderboard.api.serializers import ErrorSerializer
from leaderboard.api.views import visible
from leaderboard.models import User


class ReceiptView(APIView):
    """The signed receipt of a score."""

    @extend_schema(
        operation_id="receipt",
        parameters=[
            OpenApiParameter(
                "edition",
                int,
                description="Number of a published edition in which the submission is scored; without it, "
                "the one that is the board.",
            ),
        ],
        responses={
            200: ReceiptSerializer,
            (400, "application/problem+json"): ErrorSerializer,
            (404, "application/problem+json"): ErrorSerializer,
            (409, "application/problem+json"): ErrorSerializer,
        },
    )
    def get(self, request: Request, submission_id: str) -> Response:
        """What a submission scored, signed, for its team: check it offline with `tsttc verify`."""
        text = request.query_params.get("edition")
        number = edition_number(text) if text is not None else None
        rows = visible(request).filter(method__team__memberships__user=cast("User", request.user))
        submission = get_object_or_404(rows, pk=submission_id)
        return Response(receipts.receipt(submission=submission, edition_number=number))
