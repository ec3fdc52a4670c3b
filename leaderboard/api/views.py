"""The API's doors: each view calls one verb."""

from typing import cast

from django.http import FileResponse, Http404, HttpResponseBase, QueryDict
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter, OpenApiResponse, extend_schema
from rest_framework.parsers import MultiPartParser
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard import files, quotas, standings, submissions
from leaderboard.api.authentication import require_split, split_of
from leaderboard.api.serializers import (
    BoardSerializer,
    ErrorSerializer,
    NewSubmissionSerializer,
    SplitSerializer,
    SubmissionSerializer,
    SubmittedSerializer,
    absolute,
)
from leaderboard.api.throttles import SubmitThrottle
from leaderboard.models import Split, Submission, User
from leaderboard.models.submissions import SubmissionQuerySet

TEXT_FIELDS = ("description", "paper_url", "code_url", "note", "commit")


def visible(request: Request) -> SubmissionQuerySet:
    """The submissions that whoever asks may see, with a token for one split only those to it."""
    rows = Submission.objects.visible_to(request.user).select_related("method__team", "split")
    only = split_of(request.auth)
    return rows.filter(split=only) if only is not None else rows


class SubmissionsView(APIView):
    """Submit a prediction file; list one's own submissions."""

    parser_classes = [MultiPartParser]
    throttle_classes = [*APIView.throttle_classes, SubmitThrottle]

    @extend_schema(
        operation_id="submit",
        request={"multipart/form-data": NewSubmissionSerializer},
        responses={
            201: SubmittedSerializer,
            200: OpenApiResponse(
                SubmittedSerializer, "The same bytes had come before: the first submission."
            ),
            (409, "application/problem+json"): ErrorSerializer,
            (413, "application/problem+json"): ErrorSerializer,
            (422, "application/problem+json"): ErrorSerializer,
            (429, "application/problem+json"): ErrorSerializer,
        },
    )
    def post(self, request: Request) -> Response:
        """Send one file for one split. Answered when it is safely stored; the scores follow."""
        now = timezone.now()
        form = cast("QueryDict", request.data)  # the only parser here is that of multipart bodies
        require_split(request.auth, str(form.get("split", "")))
        upload = request.FILES.get("file")
        submitted = submissions.submit(
            user=cast("User", request.user),
            split_name=str(form.get("split", "")),
            method_name=str(form.get("method", "")),
            upload=upload,
            via=Submission.Via.API,
            now=now,
            filename=getattr(upload, "name", "") or "",
            **{name: str(form.get(name, "")) for name in TEXT_FIELDS},
        )
        made = submitted.submission
        quota = quotas.state(team=made.method.team, split=made.split, now=now)
        return Response(
            SubmittedSerializer(made, context={"quota": quota}).data,
            status=201 if submitted.is_new else 200,
            headers={"Location": absolute("api-submission", made.pk)},
        )

    @extend_schema(operation_id="list_submissions", responses=SubmissionSerializer(many=True))
    def get(self, request: Request) -> Response:
        """The newest hundred submissions of one's own team."""
        rows = visible(request)[:100]
        return Response(SubmissionSerializer(rows, many=True).data)  # type: ignore[arg-type]  # many rows, as it says


class SubmissionView(APIView):
    """One submission."""

    @extend_schema(
        operation_id="submission",
        responses={200: SubmissionSerializer, (404, "application/problem+json"): ErrorSerializer},
    )
    def get(self, request: Request, submission_id: str) -> Response:
        """State, then scores or problems. What is not one's own does not exist."""
        return Response(SubmissionSerializer(get_object_or_404(visible(request), pk=submission_id)).data)


class WithdrawView(APIView):
    """Withdraw one's own submission."""

    @extend_schema(
        operation_id="withdraw",
        request=None,
        responses={200: SubmissionSerializer, (404, "application/problem+json"): ErrorSerializer},
    )
    def post(self, request: Request, submission_id: str) -> Response:
        """Cancel what waits; what was published leaves a tombstone. Cannot be undone."""
        submission = get_object_or_404(visible(request), pk=submission_id)
        submissions.withdraw(submission=submission, actor=cast("User", request.user), now=timezone.now())
        return Response(SubmissionSerializer(submission).data)


class SplitsView(APIView):
    """The splits."""

    permission_classes = [AllowAny]

    @extend_schema(operation_id="list_splits", responses=SplitSerializer(many=True))
    def get(self, request: Request) -> Response:
        """Every split with its published edition."""
        rows = Split.objects.select_related("published_edition__ground_truth")
        return Response(SplitSerializer(rows, many=True).data)  # type: ignore[arg-type]  # many rows, as it says


class BoardView(APIView):
    """The board of a split."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="board",
        parameters=[
            OpenApiParameter("sort", str, description="A column's name; '-' before it reverses."),
            OpenApiParameter("at", str, description="A date or time: the board as it stood then."),
        ],
        responses={
            200: BoardSerializer,
            (400, "application/problem+json"): ErrorSerializer,
            (404, "application/problem+json"): ErrorSerializer,
        },
    )
    def get(self, request: Request, split: str) -> Response:
        """Submissions and published rows, ranked by published MiD."""
        found = get_object_or_404(Split.objects.select_related("published_edition__ground_truth"), pk=split)
        at = request.query_params.get("at")
        board = standings.board(
            split=found,
            viewer=request.user,
            sort=request.query_params.get("sort", "rank"),
            at=standings.parse_moment(at) if at else None,
        )
        return Response(BoardSerializer(board).data)


class ManifestView(APIView):
    """The public manifest of a split's published ground truth."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="manifest",
        responses={(200, "text/csv"): str, (404, "application/problem+json"): ErrorSerializer},
    )
    def get(self, request: Request, split: str) -> HttpResponseBase:
        """All columns of the ground truth but the time to contact, as CSV."""
        found = get_object_or_404(Split.objects.select_related("published_edition__ground_truth"), pk=split)
        if found.published_edition is None:
            raise Http404
        digest = found.published_edition.ground_truth.manifest_digest
        return FileResponse(
            files.store().open(files.manifest_name(digest), "rb"),
            as_attachment=True,
            filename=f"tsttc-{found.pk}-manifest.csv",
            content_type="text/csv",
        )
