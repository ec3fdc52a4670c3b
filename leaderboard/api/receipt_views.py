"""Score receipts, for the submission's own team."""

from typing import cast

from django.shortcuts import get_object_or_404
from drf_spectacular.utils import OpenApiParameter, extend_schema
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard.api.exceptions import edition_number
from leaderboard.api.receipt_serializers import ReceiptSerializer
from leaderboard.api.schema import errors
from leaderboard.api.views import visible
from leaderboard.models import User
from leaderboard.submissions import receipts


class ReceiptView(APIView):
    """The signed receipt of a score."""

    @extend_schema(
        operation_id="receipt",
        parameters=[
            OpenApiParameter(
                "edition",
                int,
                description="Number of a published edition that scored the submission; default: the current.",
            ),
        ],
        responses={
            200: ReceiptSerializer,
            **errors(400, 404, 409),
        },
    )
    def get(self, request: Request, submission_id: str) -> Response:
        """The signed scores of a submission, for its team; verify them offline with `tsttc verify`."""
        text = request.query_params.get("edition")
        number = edition_number(text) if text is not None else None
        rows = visible(request).filter(method__team__memberships__user=cast("User", request.user))
        submission = get_object_or_404(rows, pk=submission_id)
        return Response(receipts.receipt(submission=submission, edition_number=number))
