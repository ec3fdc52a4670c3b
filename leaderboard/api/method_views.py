"""Methods over the API: what is said of them, and who sees them."""

from datetime import UTC, datetime
from typing import Any, cast
from uuid import UUID

from django.shortcuts import get_object_or_404
from django.utils import timezone
from django.utils.dateparse import parse_datetime
from drf_spectacular.utils import OpenApiParameter, extend_schema
from rest_framework import exceptions
from rest_framework.permissions import IsAuthenticatedOrReadOnly
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from leaderboard import methods, visibility
from leaderboard.api import listing
from leaderboard.api.authentication import split_of
from leaderboard.api.bodies import DocumentParser
from leaderboard.api.method_shapes import (
    ForeseenSerializer,
    MethodChangesSerializer,
    MethodSerializer,
    ShowSerializer,
)
from leaderboard.api.problems import BadValue
from leaderboard.api.serializers import ErrorSerializer
from leaderboard.models import Method, User, Visibility
from leaderboard.texts import Refused

NOT_FOUND = {(404, "application/problem+json"): ErrorSerializer}
REFUSED = {**NOT_FOUND, (422, "application/problem+json"): ErrorSerializer}


def _shape(method: Method, request: Request) -> dict[str, Any]:
    return cast("dict[str, Any]", MethodSerializer(method, context={"viewer": request.user}).data)


def _own(request: Request, method_id: UUID) -> Method:
    """One of one's own team's methods; with a token for one split none, since a method is on every split."""
    if split_of(request.auth) is not None:
        raise exceptions.PermissionDenied(
            "The token is good for one split alone; expected one for every split, since methods are on all.",
            code="token-split",
        )
    return get_object_or_404(Method.objects.of(request.user).select_related("team"), pk=method_id)


def _fields(request: Request) -> dict[str, Any]:
    if not isinstance(request.data, dict):
        raise Refused("bad-value", "The body is no JSON object; expected one.")
    return request.data


class MethodsView(APIView):
    """One's own team's methods."""

    @extend_schema(
        operation_id="list_methods",
        parameters=listing.PARAMETERS,
        responses={200: MethodSerializer(many=True), (400, "application/problem+json"): ErrorSerializer},
    )
    def get(self, request: Request) -> Response:
        """Every one of them, by name, a page at a time; `Link` names the next page."""
        rows = Method.objects.of(request.user).select_related("team")
        page = listing.page_of(rows, request, order="name")
        return Response([_shape(row, request) for row in page.rows], headers=page.headers)


class MethodView(APIView):
    """One method."""

    parser_classes = [DocumentParser]
    permission_classes = [IsAuthenticatedOrReadOnly]

    @extend_schema(operation_id="method", responses={200: MethodSerializer, **NOT_FOUND})
    def get(self, request: Request, method_id: UUID) -> Response:
        """What is said of it; of an anonymous one that is not one's own, what it shows."""
        rows = Method.objects.visible_to(request.user).select_related("team")
        return Response(_shape(get_object_or_404(rows, pk=method_id), request))

    @extend_schema(
        operation_id="edit_method",
        request=MethodChangesSerializer,
        responses={200: MethodSerializer, **REFUSED},
    )
    def patch(self, request: Request, method_id: UUID) -> Response:
        """Say something else of one's own method; what the body does not name stays, null takes back."""
        found = _own(request, method_id)
        edited = methods.edit(method=found, changes=_fields(request), actor=cast("User", request.user))
        return Response(_shape(edited, request))


AS = OpenApiParameter(
    "as",
    str,
    required=True,
    enum=[Visibility.ANONYMOUS, Visibility.PUBLIC],
    description="How it would be shown.",
)


class VisibilityView(APIView):
    """Who sees a method."""

    parser_classes = [DocumentParser]

    @extend_schema(
        operation_id="foresee_method",
        parameters=[AS],
        responses={200: ForeseenSerializer, (400, "application/problem+json"): ErrorSerializer, **REFUSED},
    )
    def get(self, request: Request, method_id: UUID) -> Response:
        """What everybody would see of one's own method if it were shown: its rows, and whose ranks change."""
        found, now = _own(request, method_id), timezone.now()
        wanted = request.query_params.get("as", "")
        if wanted not in (Visibility.ANONYMOUS, Visibility.PUBLIC):
            raise BadValue("bad-visibility", "as", wanted, "ANONYMOUS or PUBLIC")
        visibility.require_possible(found, visibility=wanted, reveal_at=None, now=now)
        return Response(ForeseenSerializer(visibility.preview(method=found, visibility=wanted, now=now)).data)

    @extend_schema(
        operation_id="show_method", request=ShowSerializer, responses={200: MethodSerializer, **REFUSED}
    )
    def post(self, request: Request, method_id: UUID) -> Response:
        """Show one's own method to everybody, anonymous or public. Cannot be taken back: needs `confirm`."""
        found = _own(request, method_id)
        fields = _fields(request)
        if fields.get("confirm") is not True:
            raise Refused(
                "not-confirmed",
                "Showing a method cannot be taken back; expected the field 'confirm' to be true.",
                field="confirm",
            )
        shown = visibility.change(
            method=found,
            visibility=str(fields.get("visibility", "")),
            reveal_at=_moment(fields.get("reveal_at")),
            actor=cast("User", request.user),
            now=timezone.now(),
        )
        return Response(_shape(shown, request))


def _moment(value: object) -> datetime | None:
    if value is None:
        return None
    try:
        found = parse_datetime(value) if isinstance(value, str) else None
        if found is not None:
            return found.astimezone(UTC) if found.tzinfo else found.replace(tzinfo=UTC)
    except (ValueError, OverflowError):
        pass
    raise Refused(
        "bad-value",
        f"The field 'reveal_at' is {str(value)[:60]!r}; expected one such as 2027-03-01T00:00:00Z, or null.",
        field="reveal_at",
    )
