"""What only a submission's own team gets: the receipt of its score, and its file."""

from typing import cast

from django.http import HttpResponse, HttpResponseBase, HttpResponseNotModified
from django.shortcuts import get_object_or_404
from drf_spectacular.utils import OpenApiParameter, extend_schema
from rest_framework.request import Request
from rest_framework.views import APIView

from leaderboard.api.exceptions import edition_number
from leaderboard.api.schema import errors
from leaderboard.api.views import visible
from leaderboard.http_caching import is_known
from leaderboard.models import Submission, User
from leaderboard.ops import downloads
from leaderboard.storage import files
from leaderboard.submissions import receipts


class ReceiptView(APIView):
    @extend_schema(
        operation_id="receipt",
        parameters=[
            OpenApiParameter(
                "edition",
                int,
                description="Number of a published edition that scored the submission; default: the current.",
            ),
        ],
        responses={(200, receipts.MEDIA_TYPE): str, **errors(400, 404, 409)},
    )
    def get(self, request: Request, submission_id: str) -> HttpResponse:
        """The signed scores of a submission, for its team: a JSON Web Token for `tsttc verify`."""
        text = request.query_params.get("edition")
        number = edition_number(text) if text is not None else None
        submission = _own(request, submission_id)
        document = receipts.receipt(submission=submission, edition_number=number)
        return HttpResponse(document, content_type=receipts.MEDIA_TYPE)


class FileView(APIView):
    @extend_schema(
        operation_id="submission_file", responses={(200, "application/octet-stream"): bytes, **errors(404)}
    )
    def get(self, request: Request, submission_id: str) -> HttpResponseBase:
        """The bytes as your team sent them. Another team's file returns 404, even for maintainers."""
        submission = _own(request, submission_id)
        tag = {"ETag": f'"{submission.digest}"'}
        if is_known(request._request, tag["ETag"]):
            return HttpResponseNotModified(headers=tag)
        file = files.open_named(files.predictions_name(submission.digest))
        return downloads.file_response(
            file,
            n_bytes=file.size,
            as_attachment=True,
            filename=submission.filename or "predictions.json",
            content_type="application/octet-stream",
            headers=tag,
        )


def _own(request: Request, submission_id: str) -> Submission:
    rows = visible(request).filter(method__team__memberships__user=cast("User", request.user))
    return get_object_or_404(rows, pk=submission_id)
