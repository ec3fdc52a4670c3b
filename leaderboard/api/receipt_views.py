"""What only a submission's own team gets: the receipt of its score, and its file."""

from typing import Any, cast

from django.http import FileResponse, Http404, HttpResponseBase, HttpResponseNotModified
from django.shortcuts import get_object_or_404
from drf_spectacular.utils import OpenApiParameter, extend_schema
from rest_framework import serializers
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard.api.exceptions import edition_number
from leaderboard.api.schema import errors
from leaderboard.api.serializers import (
    EDITION,
    GROUND_TRUTH,
    PROTOCOL,
    SPLIT,
    CountsSerializer,
    NamedSerializer,
)
from leaderboard.api.views import visible
from leaderboard.http import is_known
from leaderboard.models import Submission, User
from leaderboard.storage import files
from leaderboard.submissions import receipts


class ReceiptScoresSerializer(NamedSerializer):
    """The published scores as decimal texts."""

    def child(self, name: str, **options: Any) -> serializers.CharField:
        """The text of one score."""
        text = "Score with the edition's decimals; null: the TTC range has no sequence."
        return serializers.CharField(allow_null=True, help_text=text, **options)


class ReceiptCountsSerializer(CountsSerializer):
    """Number of sequences, overall and in each TTC range."""

    def child(self, name: str, **options: Any) -> serializers.IntegerField:
        """One count."""
        return serializers.IntegerField(help_text="Number of sequences behind the mean.", **options)


class ReceiptMethodSerializer(serializers.Serializer[Any]):
    """The method as its team names it."""

    id = serializers.UUIDField(help_text="Id of the method.")
    name = serializers.CharField(help_text="Its real name when the receipt was signed, even if anonymous.")


class ReceiptSerializer(serializers.Serializer[Any]):
    """A signed score. Keep the file unchanged: every change except spacing invalidates the signature."""

    kind = serializers.CharField(help_text="Always `tsttc-score-receipt`.")
    version = serializers.IntegerField(help_text="Version of the receipt format.")
    site = serializers.CharField(help_text="URL of the leaderboard that signed it.")
    key_id = serializers.CharField(help_text="RFC 7638 thumbprint of the signing key.")
    submission = serializers.UUIDField(help_text="Id of the submission.")
    split = serializers.CharField(help_text=SPLIT)
    edition = serializers.IntegerField(help_text=EDITION)
    protocol = serializers.CharField(help_text=PROTOCOL)
    ground_truth = serializers.CharField(help_text=GROUND_TRUTH)
    file = serializers.CharField(help_text="Digest of the prediction file's bytes.")
    method = ReceiptMethodSerializer(help_text="The method.")
    scores = ReceiptScoresSerializer(help_text="The published scores.")
    counts = ReceiptCountsSerializer(help_text="Number of sequences behind each mean.")
    scored_at = serializers.DateTimeField(help_text="When it was scored, UTC.")
    signature = serializers.CharField(help_text="Ed25519, base64url, over the canonical form of the rest.")


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
        submission = _own(request, submission_id)
        return Response(receipts.receipt(submission=submission, edition_number=number))


class FileView(APIView):
    """The prediction file of a submission."""

    @extend_schema(
        operation_id="submission_file", responses={(200, "application/octet-stream"): bytes, **errors(404)}
    )
    def get(self, request: Request, submission_id: str) -> HttpResponseBase:
        """The bytes as your team sent them. The file of another team gives 404, also for maintainers."""
        submission = _own(request, submission_id)
        name = files.predictions_name(submission.digest)
        if not files.store().exists(name):
            raise Http404
        tag = {"ETag": f'"{submission.digest}"'}
        if is_known(request._request, tag["ETag"]):
            return HttpResponseNotModified(headers=tag)
        return FileResponse(
            files.store().open(name, "rb"),
            as_attachment=True,
            filename=submission.filename or "predictions.json",
            content_type="application/octet-stream",
            headers=tag,
        )


def _own(request: Request, submission_id: str) -> Submission:
    """A submission of the user's own team. Raises `Http404`."""
    rows = visible(request).filter(method__team__memberships__user=cast("User", request.user))
    return get_object_or_404(rows, pk=submission_id)
