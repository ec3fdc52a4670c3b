"""Methods: their details and their visibility. A field once here stays."""

from datetime import datetime
from typing import Any, cast
from uuid import UUID

from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter, extend_schema
from rest_framework import exceptions, serializers
from rest_framework.permissions import IsAuthenticatedOrReadOnly
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.utils.serializer_helpers import ReturnDict
from rest_framework.views import APIView

from leaderboard.api import pagination
from leaderboard.api.authentication import split_of
from leaderboard.api.exceptions import BadValue
from leaderboard.api.parsers import LimitedJSONParser
from leaderboard.api.schema import errors
from leaderboard.api.serializers import (
    CODE_URL,
    DETAILS,
    EDITION,
    FIELD_OF,
    METHOD_ID,
    PAPER_URL,
    SPLIT,
    DetailsSerializer,
    EntrySerializer,
    absolute,
)
from leaderboard.boards import results, visibility_preview
from leaderboard.boards.visibility_preview import BoardPreview, RankChange, VisibilityPreview
from leaderboard.errors.refusals import Refused
from leaderboard.methods import details, editing, visibility
from leaderboard.methods.visibility import notice_of
from leaderboard.models import Method, Scope, User, Visibility


class MethodSerializer(serializers.Serializer[Method]):
    """A method as the reader may see it. Where `is_named` is false, it is anonymous to the reader."""

    id = serializers.UUIDField(help_text="Permanent id of the method.")
    name = serializers.CharField(help_text="Name of the method; of an anonymous one its pseudonym.")
    team = serializers.CharField(help_text="Name of the team.")
    visibility = serializers.ChoiceField(choices=Visibility.choices, help_text="Who may see the method.")
    is_named = serializers.BooleanField(help_text="Whether the reader sees the names; false: anonymous.")
    pseudonym = serializers.CharField(
        allow_null=True, help_text="Name that others see. Visible to the team alone."
    )
    description = serializers.CharField(allow_blank=True, help_text="Description by the team.")
    paper_url = serializers.CharField(allow_blank=True, help_text=PAPER_URL)
    code_url = serializers.CharField(allow_blank=True, help_text=CODE_URL)
    details = DetailsSerializer(help_text=DETAILS)
    shown_at = serializers.DateTimeField(
        allow_null=True, help_text="When it was published. Visible to the team alone."
    )
    reveal_at = serializers.DateTimeField(
        allow_null=True, help_text="When it becomes public by itself. Visible to the team alone."
    )
    notice = serializers.CharField(
        allow_blank=True,
        help_text="Who sees its results, in a sentence; empty if private. Visible to the team alone.",
    )
    url = serializers.URLField(help_text="URL of the method's page.")
    api_url = serializers.URLField(help_text="URL of the method in this API.")

    def to_representation(self, instance: Method) -> dict[str, Any]:
        viewer = self.context["viewer"]
        profile = results.profile(method=instance, viewer=viewer)
        is_own = instance.is_named_for(viewer) and viewer.is_authenticated and editing.is_of(instance, viewer)
        return {
            "id": str(instance.pk),
            "name": profile.name,
            "team": profile.team,
            "visibility": instance.visibility,
            "is_named": instance.is_named_for(viewer),
            "pseudonym": instance.pseudonym if is_own else None,
            "description": profile.description,
            "paper_url": profile.paper_url,
            "code_url": profile.code_url,
            "details": profile.details,
            "shown_at": instance.shown_at if is_own else None,
            "reveal_at": instance.reveal_at if is_own else None,
            "notice": notice_of(instance) if is_own else "",
            "url": absolute("method", instance.pk),
            "api_url": absolute("api-method", instance.pk),
        }


class MethodChangesSerializer(serializers.Serializer[Any]):
    """Changes of a method. Fields left out stay as they are; null clears a field."""

    name = serializers.CharField(
        required=False, max_length=80, help_text="Name; cannot be changed once the method is public."
    )
    description = serializers.CharField(
        required=False, allow_null=True, max_length=2000, help_text="Description of the method."
    )
    paper_url = serializers.CharField(required=False, allow_null=True, max_length=500, help_text=PAPER_URL)
    code_url = serializers.CharField(required=False, allow_null=True, max_length=500, help_text=CODE_URL)

    def get_fields(self) -> dict[str, serializers.Field[Any, Any, Any, Any]]:
        fields = super().get_fields()
        for detail in details.DETAILS:
            limits = detail.kind.limits
            field = serializers.ChoiceField if "choices" in limits else FIELD_OF[detail.kind.type]
            fields[detail.name] = field(**limits, required=False, allow_null=True, help_text=detail.help)
        return fields


class RankChangeSerializer(serializers.Serializer[RankChange]):
    """Another row of the board whose rank would change."""

    method = serializers.CharField(source="entry.method", help_text="Name of the method.")
    method_id = serializers.UUIDField(source="entry.method_id", allow_null=True, help_text=METHOD_ID)
    rank_before = serializers.IntegerField(source="entry.rank", allow_null=True, help_text="Current rank.")
    rank_after = serializers.IntegerField(allow_null=True, help_text="Rank after the publication.")


class BoardPreviewSerializer(serializers.Serializer[BoardPreview]):
    """A preview of one split's public board."""

    split = serializers.CharField(source="split.name", help_text=SPLIT)
    edition = serializers.IntegerField(source="edition.number", help_text=EDITION)
    n_ranked = serializers.IntegerField(help_text="Number of ranked rows that the board would have.")
    before = EntrySerializer(allow_null=True, help_text="The method's current public row, if any.")
    after = EntrySerializer(source="entry", help_text="The method's public row after the publication.")
    n_attempts_before = serializers.IntegerField(
        source="n_attempts_now",
        allow_null=True,
        help_text="Current attempts in the team's other public rows; null: it has none.",
    )
    moved = RankChangeSerializer(many=True, help_text="Other rows whose ranks would change, in board order.")


class VisibilityPreviewSerializer(serializers.Serializer[VisibilityPreview]):
    """What everybody would see of a method. The request changes nothing."""

    visibility = serializers.ChoiceField(
        choices=[Visibility.ANONYMOUS, Visibility.PUBLIC], help_text="The visibility that is previewed."
    )
    name = serializers.CharField(source="profile.name", help_text="Name; if anonymous the pseudonym.")
    team = serializers.CharField(source="profile.team", help_text="Name of the team.")
    description = serializers.CharField(
        source="profile.description", allow_blank=True, help_text="Description by the team."
    )
    paper_url = serializers.CharField(source="profile.paper_url", allow_blank=True, help_text=PAPER_URL)
    code_url = serializers.CharField(source="profile.code_url", allow_blank=True, help_text=CODE_URL)
    details = DetailsSerializer(source="profile.details", help_text=DETAILS)
    splits = BoardPreviewSerializer(source="boards", many=True, help_text="Boards on which it has a row.")


class VisibilityChangeSerializer(serializers.Serializer[Any]):
    """A method's new visibility."""

    visibility = serializers.ChoiceField(
        choices=[Visibility.ANONYMOUS, Visibility.PUBLIC], help_text="Who may see the method."
    )
    reveal_at = serializers.DateTimeField(
        required=False, allow_null=True, help_text="When an anonymous method becomes public by itself."
    )
    confirm = serializers.BooleanField(help_text="Must be true: publishing cannot be undone.")


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
        raise Refused("bad-value", "The body is not a JSON object; expected one.")
    return request.data


class MethodsView(APIView):
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
    parser_classes = [LimitedJSONParser]
    permission_classes = [IsAuthenticatedOrReadOnly]

    @extend_schema(operation_id="method", responses={200: MethodSerializer, **errors(404)})
    def get(self, request: Request, method_id: UUID) -> Response:
        """A method and its details; for another team's anonymous method, only its public fields."""
        rows = Method.objects.visible_to(request.user).select_related("team")
        return Response(_data(get_object_or_404(rows, pk=method_id), request))

    @extend_schema(
        operation_id="edit_method",
        request=MethodChangesSerializer,
        responses={200: MethodSerializer, **errors(404, 422)},
    )
    def patch(self, request: Request, method_id: UUID) -> Response:
        """Edit a method of your team: omitted fields do not change, null clears a field."""
        method = _own(request, method_id)
        edited = editing.edit(method=method, changes=_fields(request), actor=cast("User", request.user))
        return Response(_data(edited, request))


AS = OpenApiParameter(
    "as",
    str,
    required=True,
    enum=[Visibility.ANONYMOUS, Visibility.PUBLIC],
    description="The visibility to preview.",
)


class VisibilityView(APIView):
    parser_classes = [LimitedJSONParser]
    writing_scope = Scope.PUBLISH

    @extend_schema(
        operation_id="preview_visibility",
        parameters=[AS],
        responses={200: VisibilityPreviewSerializer, **errors(400, 404, 422)},
    )
    def get(self, request: Request, method_id: UUID) -> Response:
        """Preview the publication of your method: its public rows, and the ranks that would change."""
        method, now = _own(request, method_id), timezone.now()
        wanted = request.query_params.get("as", "")
        if wanted not in (Visibility.ANONYMOUS, Visibility.PUBLIC):
            raise BadValue("bad-visibility", "as", wanted, "ANONYMOUS or PUBLIC")
        visibility.require_possible(method, visibility=wanted, reveal_at=None, now=now)
        preview = visibility_preview.preview(method=method, visibility=wanted, now=now)
        return Response(VisibilityPreviewSerializer(preview).data)

    @extend_schema(
        operation_id="show_method",
        request=VisibilityChangeSerializer,
        responses={200: MethodSerializer, **errors(404, 422)},
    )
    def post(self, request: Request, method_id: UUID) -> Response:
        """Publish your method, anonymous or public.

        This cannot be undone: it needs `confirm`, and a token needs the scope `publish`.
        """
        method, fields = _own(request, method_id), _fields(request)
        if fields.get("confirm") is not True:
            sentence = "Publishing a method cannot be undone; expected the field 'confirm' to be true."
            raise Refused("not-confirmed", sentence, field="confirm")
        published = visibility.change(
            method=method,
            visibility=str(fields.get("visibility", "")),
            reveal_at=_moment(fields.get("reveal_at")),
            actor=cast("User", request.user),
            now=timezone.now(),
        )
        return Response(_data(published, request))


def _moment(value: Any) -> datetime | None:
    if value is None:
        return None
    try:
        return serializers.DateTimeField().to_internal_value(value)
    except serializers.ValidationError:
        expected = "one such as 2027-03-01T00:00:00Z, or null"
        raise details.bad_value("reveal_at", value, expected) from None
