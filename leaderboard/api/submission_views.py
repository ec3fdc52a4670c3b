"""Submitting over the API, and following what was submitted."""

import random
import select
import socket
from collections.abc import Mapping
from datetime import datetime
from functools import partial
from typing import Any, cast
from uuid import UUID

from django.core.files.uploadedfile import UploadedFile
from django.db.models import Prefetch
from django.http import QueryDict
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter, OpenApiResponse, extend_schema
from rest_framework.parsers import MultiPartParser
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard import files, idempotency, method_ids, outcomes, quotas, submissions, waiting
from leaderboard.api import listing
from leaderboard.api.authentication import require_split, split_of
from leaderboard.api.problems import BadValue
from leaderboard.api.serializers import ErrorSerializer, absolute
from leaderboard.api.submission_shapes import (
    NewSubmissionSerializer,
    SubmissionSerializer,
    SubmittedSerializer,
)
from leaderboard.api.throttles import SubmitThrottle
from leaderboard.api.views import visible
from leaderboard.models import Evaluation, Submission, User

TEXT_FIELDS = ("description", "paper_url", "code_url", "note", "commit")


EVALUATIONS = Evaluation.objects.select_related("edition__ground_truth").prefetch_related("scores")


class SubmissionsView(APIView):
    """Submit a prediction file; list one's own submissions."""

    parser_classes = [MultiPartParser]
    throttle_classes = [*APIView.throttle_classes, SubmitThrottle]

    @extend_schema(
        operation_id="submit",
        parameters=[
            OpenApiParameter(
                "Idempotency-Key",
                str,
                OpenApiParameter.HEADER,
                description="Your own name for this request: the same request sent again with it is answered "
                "with the same submission. Kept for at least 7 days.",
            ),
            OpenApiParameter(
                "Location",
                str,
                OpenApiParameter.HEADER,
                description="The submission's address.",
                response=[200, 201],
            ),
            OpenApiParameter(
                "Idempotent-Replayed",
                str,
                OpenApiParameter.HEADER,
                description="`true` where this answer is a former request's.",
                response=[200],
            ),
        ],
        request={"multipart/form-data": NewSubmissionSerializer},
        responses={
            201: SubmittedSerializer,
            200: OpenApiResponse(
                SubmittedSerializer,
                "The same bytes, or the same Idempotency-Key, had come before: the first submission.",
            ),
            (400, "application/problem+json"): ErrorSerializer,
            (409, "application/problem+json"): ErrorSerializer,
            (413, "application/problem+json"): ErrorSerializer,
            (422, "application/problem+json"): ErrorSerializer,
            (429, "application/problem+json"): ErrorSerializer,
        },
    )
    def post(self, request: Request) -> Response:
        """Send one file for one split. Answered when it is safely stored; the scores follow."""
        form = cast("QueryDict", request.data)  # the only parser here is that of multipart bodies
        require_split(request.auth, str(form.get("split", "")))
        answer = _submit(request, form)
        made = answer.submitted.submission
        quota = quotas.state(
            team=made.method.team, user=cast("User", request.user), split=made.split, now=timezone.now()
        )
        replayed = {"Idempotent-Replayed": "true"} if answer.is_replayed else {}
        return Response(
            SubmittedSerializer(_told(made), context={"quota": quota}).data,
            status=201 if answer.submitted.is_new else 200,
            headers={"Location": absolute("api-submission", made.pk), **replayed},
        )

    @extend_schema(
        operation_id="list_submissions",
        parameters=listing.PARAMETERS,
        responses={
            200: SubmissionSerializer(many=True),
            (400, "application/problem+json"): ErrorSerializer,
        },
    )
    def get(self, request: Request) -> Response:
        """The submissions of one's own team, newest first, a page at a time; `Link` names the next page."""
        rows = visible(request).prefetch_related(Prefetch("evaluations", EVALUATIONS))
        page = listing.page_of(rows, request, order="-submitted_at")
        told = outcomes.of(page.rows, now=timezone.now())
        data = SubmissionSerializer(told, many=True).data  # type: ignore[arg-type]  # many rows, as it says
        return Response(data, headers=page.headers)


class SubmissionView(APIView):
    """One submission."""

    @extend_schema(
        operation_id="submission",
        parameters=[
            OpenApiParameter(
                "wait",
                int,
                description="Seconds, 0 to 60: hold the answer until the submission is final, at most for so "
                "long. Where every place to wait is taken the answer comes at once, with Retry-After.",
            ),
            OpenApiParameter(
                "Retry-After",
                int,
                OpenApiParameter.HEADER,
                description="Where there was no place to wait: seconds until asking again is worth it.",
                response=[200],
            ),
        ],
        responses={
            200: SubmissionSerializer,
            (400, "application/problem+json"): ErrorSerializer,
            (404, "application/problem+json"): ErrorSerializer,
        },
    )
    def get(self, request: Request, submission_id: UUID) -> Response:
        """State, then scores or problems. What is not one's own does not exist."""
        wait_s = _wait_s(request)
        rows = visible(request).prefetch_related(Prefetch("evaluations", EVALUATIONS))
        found = get_object_or_404(rows, pk=submission_id)
        if not wait_s or submissions.evaluation_of(found).is_final:
            return Response(SubmissionSerializer(_told(found)).data)
        gone = partial(_is_gone, request.META)
        if waiting.hold(found.pk, wait_s=wait_s, is_gone=gone):
            now_there = get_object_or_404(rows.all(), pk=submission_id)
            return Response(SubmissionSerializer(_told(now_there)).data)
        retry_after_s = waiting.THE_WATCHER.retry_after_s(rng=random.Random())  # noqa: S311 - to spread askers
        return Response(SubmissionSerializer(_told(found)).data, headers={"Retry-After": str(retry_after_s)})


def _told(submission: Submission) -> outcomes.Outcome:
    return outcomes.of([submission], now=timezone.now())[0]


def _submit(request: Request, form: QueryDict) -> idempotency.Answer:
    """One submission for this request, whether or not its like came before."""
    user, now = cast("User", request.user), timezone.now()
    upload = request.FILES.get("file")
    header = request.headers.get("Idempotency-Key")
    may_edit = split_of(request.auth) is None
    submit = partial(_take, user=user, form=form, upload=upload, now=now, may_edit=may_edit)
    if header is None:
        return idempotency.Answer(submit(), is_replayed=False)
    key = idempotency.parse(header)
    fields = {name: values for name, values in form.lists() if name not in request.FILES}
    digest = idempotency.request_digest(
        fields=fields, file_digest=files.measure(upload).digest if upload else ""
    )
    return idempotency.once(user=user, key=key, digest=digest, submit=submit, now=now)


def _take(
    *, user: User, form: QueryDict, upload: UploadedFile | None, now: datetime, may_edit: bool
) -> submissions.Submitted:
    return submissions.submit(
        user=user,
        split_name=str(form.get("split", "")),
        method_name=method_ids.name_meant(user=user, text=str(form.get("method", ""))),
        upload=upload,
        via=Submission.Via.API,
        now=now,
        filename=getattr(upload, "name", "") or "",
        may_edit=may_edit,
        **{name: str(form.get(name, "")) for name in TEXT_FIELDS},
    )


def _wait_s(request: Request) -> int:
    """The parameter `wait`. Raises `BadValue`."""
    text = request.query_params.get("wait", "0")
    if not (text.isascii() and text.isdecimal() and len(text) < 4 and int(text) <= waiting.MAX_WAIT_S):
        raise BadValue("bad-wait", "wait", text, f"whole seconds, from 0 to {waiting.MAX_WAIT_S}")
    return int(text)


def _is_gone(environ: Mapping[str, Any]) -> bool:
    """Whether whoever asked has closed the connection, as far as the web server lets us know."""
    connected = environ.get("gunicorn.socket")
    if not isinstance(connected, socket.socket):
        return False
    try:
        asked = select.poll()
        asked.register(connected, select.POLLIN)
        return bool(asked.poll(0)) and not connected.recv(1, socket.MSG_PEEK)
    except OSError:
        return True
