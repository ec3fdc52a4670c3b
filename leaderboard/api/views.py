"""Views of splits and of withdrawing, and the rows that several views look up."""

from typing import Any, cast

from django.http import Http404, HttpResponseBase, HttpResponseNotModified, JsonResponse
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter, extend_schema
from rest_framework import serializers
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard.api.authentication import split_of
from leaderboard.api.exceptions import edition_number
from leaderboard.api.parsers import LimitedJSONParser
from leaderboard.api.schema import errors
from leaderboard.api.serializers import SplitSerializer
from leaderboard.api.submission_serializers import SubmissionSerializer
from leaderboard.boards import snapshots
from leaderboard.editions import history
from leaderboard.errors.refusals import Refused
from leaderboard.exports import croissant
from leaderboard.http_caching import is_known
from leaderboard.models import Edition, Split, Submission, User
from leaderboard.models.submissions import SubmissionQuerySet
from leaderboard.ops import downloads
from leaderboard.storage import files
from leaderboard.submissions import intake, moving, outcomes


def visible(request: Request) -> SubmissionQuerySet:
    """Return the submissions visible to the user, and to a token for one split."""
    rows = Submission.objects.visible_to(request.user).select_related("method__team", "split")
    only = split_of(request.auth)
    return rows.filter(split=only) if only is not None else rows


def current_split(request: Request, name: str) -> Split:
    """Return a split from the cache. Raises `Http404`."""
    splits = snapshots.splits_of(request._request)
    match = next((split for split in splits if split.pk == name), None)
    if match is None:
        raise Http404
    return match


def published_edition(split: str | Split, number: int) -> Edition:
    """Return a published edition. Raises `Http404`."""
    return get_object_or_404(snapshots.editions(), split=split, number=number)


def no_ground_truth(split: Split) -> Refused:
    """Say why a split without an edition has no manifest."""
    return Refused("no-ground-truth", f"{split.name} has no ground truth yet, so it has no manifest.")


class WithdrawView(APIView):
    @extend_schema(
        operation_id="withdraw",
        request=None,
        responses={200: SubmissionSerializer, **errors(404, 422)},
    )
    def post(self, request: Request, submission_id: str) -> Response:
        """Permanently cancel a waiting submission or withdraw a scored one. A public row keeps no values."""
        submission = get_object_or_404(visible(request), pk=submission_id)
        now = timezone.now()
        intake.withdraw(submission=submission, actor=cast("User", request.user), now=now)
        (outcome,) = outcomes.for_submissions([submission], now=now)
        return Response(SubmissionSerializer(outcome).data)


class MoveSerializer(serializers.Serializer[Any]):
    """Where a submission is moved."""

    method = serializers.CharField(help_text="Name or id of another private method of your team.")


class MoveView(APIView):
    parser_classes = [LimitedJSONParser]

    @extend_schema(
        operation_id="move",
        request=MoveSerializer,
        responses={200: SubmissionSerializer, **errors(404, 409, 422)},
    )
    def post(self, request: Request, submission_id: str) -> Response:
        """Move a submission to another method of your team, while both are private. No slot comes back."""
        submission = get_object_or_404(visible(request), pk=submission_id)
        asked = request.data.get("method") if isinstance(request.data, dict) else None
        if not isinstance(asked, str) or not asked:
            sentence = "The field 'method' is empty; expected the name or id of a method."
            raise Refused("missing-field", sentence, field="method")
        now = timezone.now()
        user = cast("User", request.user)
        moved = moving.move(submission=submission, method_name=asked, actor=user, now=now)
        (outcome,) = outcomes.for_submissions([moved], now=now)
        return Response(SubmissionSerializer(outcome).data)


class SplitsView(APIView):
    permission_classes = [AllowAny]

    @extend_schema(operation_id="list_splits", responses=SplitSerializer(many=True))
    def get(self, request: Request) -> Response:
        """All splits with their published editions, archived ones last."""
        rows = snapshots.splits_of(request._request)
        return Response(SplitSerializer(rows, many=True).data)  # type: ignore[arg-type]  # many rows, as it says


OF_EDITION = OpenApiParameter(
    "edition", int, description="The number of an edition that is or was the board. Default: the board's."
)


class ManifestView(APIView):
    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="manifest",
        parameters=[OF_EDITION],
        responses={(200, "text/csv"): str, **errors(404)},
    )
    def get(self, request: Request, split: str) -> HttpResponseBase:
        """All columns of the ground truth but the time to contact, as CSV."""
        rows = Split.objects.shown().select_related("current_edition__ground_truth")
        row = get_object_or_404(rows, pk=split)
        number = request.GET.get("edition", "")
        if not number and row.current_edition is None:
            raise no_ground_truth(row)
        digest = history.manifest_digest(split=row, number=number)
        if digest is None:
            raise Http404
        tag = {"ETag": f'"{digest}"'}
        if is_known(request._request, tag["ETag"]):
            return HttpResponseNotModified(headers=tag)
        file = files.open_named(files.manifest_name(digest))
        return downloads.file_response(
            file,
            n_bytes=file.size,
            as_attachment=True,
            filename=f"tsttc-{row.pk}-manifest.csv",
            content_type="text/csv",
            headers=tag,
        )


class CroissantView(APIView):
    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="croissant",
        parameters=[OF_EDITION],
        responses={(200, "application/ld+json"): dict, **errors(404)},
    )
    def get(self, request: Request, split: str) -> JsonResponse:
        """The manifest as Croissant 1.1 (JSON-LD), which programs can find and load."""
        text = request.query_params.get("edition")
        row = current_split(request, split)
        current = row.current_edition
        edition = published_edition(split, edition_number(text)) if text is not None else current
        if edition is None:
            raise no_ground_truth(row)
        return JsonResponse(croissant.document(edition), content_type=croissant.MEDIA_TYPE)
