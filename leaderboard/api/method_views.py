"""Methods: their details and their visibility."""

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
from rest_framework.utils.serializer_helpers import ReturnDict
from rest_framework.views import APIView

from leaderboard.api import pagination
from leaderboard.api.authentication import split_of
from leaderboard.api.exceptions import BadValue
from leaderboard.api.method_serializers import (
    ForeseenSerializer,
    MethodChangesSerializer,
    MethodSerializer,
    ShowSerializer,
)
from leaderboard.api.parsers import LimitedJSONParser
from leaderboard.api.schema import errors
from leaderboard.boards import visibility_preview
from leaderboard.errors.refusals import Refused
from leaderboard.methods import methods, visibility
from leaderboard.models import Method, User, Visibility


def _data(method: Method, request: Request) -> ReturnDict[str, Any]:
    return MethodSerializer(method, context={"viewer": request.user}).data


def _own(request: Request, method_id: UUID) -> Method:
    """A method of the user's team. Tokens for one split are refused, since a method is on every split."""
    if split_of(request.auth) is not None:
        raise exceptions.PermissionDenied(
            "The token is valid for one split only; expected one for all splits, since methods are on all.",
            code="token-split",
        )
    return get_object_or_404(Method.objects.of(request.user).select_related("team"), pk=method_id)


def _fields(request: Request) -> dict[str, Any]:
    if not isinstance(request.data, dict):
        raise Refused("bad-value", "The body is no JSON object; expected one.")
    return request.data


class MethodsView(APIView):
    """The methods of your team."""

    @extend_schema(
        operation_id="list_methods",
        parameters=pagination.PARAMETERS,
        responses={200: MethodSerializer(many=True), **errors(400)},
    )
    def get(self, request: Request) -> Response:
        """Your team's methods by name, in pages; `Link` names the next page."""
        rows = Method.objects.of(request.user).select_related("team")
        page = pagination.page_of(rows, request, order="name")
        return Response([_data(row, request) for row in page.rows], headers=page.headers)


class MethodView(APIView):
    """One method."""

    parser_classes = [LimitedJSONParser]
    permission_classes = [IsAuthenticatedOrReadOnly]

    @extend_schema(operation_id="method", responses={200: MethodSerializer, **errors(404)})
    def get(self, request: Request, method_id: UUID) -> Response:
        """A method and its details; of another team's anonymous method only what is public."""
        rows = Method.objects.visible_to(request.user).select_related("team")
        return Response(_data(get_object_or_404(rows, pk=method_id), request))

    @extend_schema(
        operation_id="edit_method",
        request=MethodChangesSerializer,
        responses={200: MethodSerializer, **errors(404, 422)},
    )
    def patch(self, request: Request, method_id: UUID) -> Response:
        """Edit a method of your team: fields left out stay as they are, null clears a field."""
        found = _own(request, method_id)
        edited = methods.edit(method=found, changes=_fields(request), actor=cast("User", request.user))
        return Response(_data(edited, request))


AS = OpenApiParameter(
    "as",
    str,
    required=True,
    enum=[Visibility.ANONYMOUS, Visibility.PUBLIC],
    description="The visibility to preview.",
)


class VisibilityView(APIView):
    """The visibility of a method."""

    parser_classes = [LimitedJSONParser]

    @extend_schema(
        operation_id="foresee_method",
        parameters=[AS],
        responses={200: ForeseenSerializer, **errors(400, 404, 422)},
    )
    def get(self, request: Request, method_id: UUID) -> Response:
        """Preview the publication of your method: its public rows, and the ranks that would change."""
        found, now = _own(request, method_id), timezone.now()
        wanted = request.query_params.get("as", "")
        if wanted not in (Visibility.ANONYMOUS, Visibility.PUBLIC):
            raise BadValue("bad-visibility", "as", wanted, "ANONYMOUS or PUBLIC")
        visibility.require_possible(found, visibility=wanted, reveal_at=None, now=now)
        foreseen = visibility_preview.preview(method=found, visibility=wanted, now=now)
        return Response(ForeseenSerializer(foreseen).data)

    @extend_schema(
        operation_id="show_method",
        request=ShowSerializer,
        responses={200: MethodSerializer, **errors(404, 422)},
    )
    def post(self, request: Request, method_id: UUID) -> Response:
        """Publish your method, anonymous or public. Cannot be undone: needs `confirm`."""
        found, fields = _own(request, method_id), _fields(request)
        if fields.get("confirm") is not True:
            sentence = "Publishing a method cannot be undone; expected the field 'confirm' to be true."
            raise Refused("not-confirmed", sentence, field="confirm")
        published = visibility.change(
            method=found,
            visibility=str(fields.get("visibility", "")),
            reveal_at=_moment(fields.get("reveal_at")),
            actor=cast("User", request.user),
            now=timezone.now(),
        )
        return Response(_data(published, request))


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
