"""Submitting and following submissions."""

from datetime import datetime
from typing import cast
from uuid import UUID

from django.db.models import Prefetch
from django.http import QueryDict
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import OpenApiResponse, extend_schema
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard.api import pagination
from leaderboard.api.authentication import require_split, split_of
from leaderboard.api.parsers import SingleMultiPartParser
from leaderboard.api.schema import errors, response_header
from leaderboard.api.serializers import absolute
from leaderboard.api.submission_serializers import (
    NewSubmissionSerializer,
    SubmissionSerializer,
    SubmittedSerializer,
)
from leaderboard.api.throttling import SubmitThrottle
from leaderboard.api.views import visible
from leaderboard.errors.refusals import Refused
from leaderboard.methods import editing
from leaderboard.models import Evaluation, Submission, User
from leaderboard.quotas import usage
from leaderboard.submissions import intake, outcomes

FILE_AS_TEXT = "The field 'file' is a text; expected a file. With curl: -F file=@FILE, with an @."
DETAIL_FIELDS = ("description", "paper_url", "code_url")
# While a submission waits or runs; a file is scored within a second.
ASK_AGAIN_S = 1

EVALUATIONS = Evaluation.objects.select_related("edition__ground_truth").prefetch_related("scores")


class SubmissionsView(APIView):
    parser_classes = [SingleMultiPartParser]
    throttle_classes = [*APIView.throttle_classes, SubmitThrottle]

    @extend_schema(
        operation_id="submit",
        parameters=[
            response_header("Location", str, "URL of the submission.", statuses=[200, 201]),
        ],
        request={"multipart/form-data": NewSubmissionSerializer},
        responses={
            201: OpenApiResponse(SubmittedSerializer, "A new submission."),
            200: OpenApiResponse(SubmittedSerializer, "The earlier submission of the same file."),
            **errors(400, 409, 413, 422, 429),
        },
    )
    def post(self, request: Request) -> Response:
        """Submit one file to one split. The server responds once the file is stored; the scores follow."""
        form = cast("QueryDict", request.data)  # the only parser here is that of multipart bodies
        require_split(request.auth, str(form.get("split", "")))
        now = timezone.now()
        answer = intake.submit(_submission_request(request, form, now=now))
        made = answer.submission
        quota = usage.state(team=made.method.team, user=cast("User", request.user), split=made.split, now=now)
        (outcome,) = outcomes.for_submissions([made], now=now)
        return Response(
            SubmittedSerializer(outcome, context={"quota": quota, "notes": answer.notes}).data,
            status=201 if answer.is_new else 200,
            headers={"Location": absolute("api-submission", made.pk)},
        )

    @extend_schema(
        operation_id="list_submissions",
        parameters=pagination.PARAMETERS,
        responses={200: SubmissionSerializer(many=True), **errors(400)},
    )
    def get(self, request: Request) -> Response:
        """Your team's submissions, newest first, in pages; `Link` names the next page."""
        rows = visible(request).prefetch_related(Prefetch("evaluations", EVALUATIONS))
        page = pagination.page_of(rows, request, order="-submitted_at")
        views = outcomes.for_submissions(page.rows, now=timezone.now())
        data = SubmissionSerializer(views, many=True).data  # type: ignore[arg-type]  # many rows, as it says
        return Response(data, headers=page.headers)


class SubmissionView(APIView):
    @extend_schema(
        operation_id="submission",
        parameters=[
            response_header(
                "Retry-After",
                int,
                "Seconds after which to repeat the request; absent once the submission is final.",
                statuses=[200],
            ),
        ],
        responses={200: SubmissionSerializer, **errors(404)},
    )
    def get(self, request: Request, submission_id: UUID) -> Response:
        """State, then scores or problems. Another team's submission returns 404."""
        rows = visible(request).prefetch_related(Prefetch("evaluations", EVALUATIONS))
        submission = get_object_or_404(rows, pk=submission_id)
        (view,) = outcomes.for_submissions([submission], now=timezone.now())
        again = {} if view.progress.is_final else {"Retry-After": str(ASK_AGAIN_S)}
        return Response(SubmissionSerializer(view).data, headers=again)


def _submission_request(request: Request, form: QueryDict, *, now: datetime) -> intake.SubmissionRequest:
    user, upload = cast("User", request.user), request.FILES.get("file")
    if upload is None and "file" in form:
        raise Refused("no-file", FILE_AS_TEXT, field="file")
    return intake.SubmissionRequest(
        user=user,
        split_name=str(form.get("split", "")),
        method_name=editing.method_name_of(user=user, text=str(form.get("method", ""))),
        upload=upload,
        via=Submission.Via.API,
        now=now,
        filename=getattr(upload, "name", "") or "",
        details={name: str(form.get(name, "")) for name in DETAIL_FIELDS},
        note=str(form.get("note", "")),
        commit=str(form.get("commit", "")),
        may_edit=split_of(request.auth) is None,
    )
