"""Serializers of methods. A field once here stays."""

from typing import Any

from rest_framework import serializers

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
from leaderboard.boards import results
from leaderboard.boards.visibility_preview import BoardPreview, RankChange, VisibilityPreview
from leaderboard.methods import details, methods
from leaderboard.methods.visibility import notice_of
from leaderboard.models import Method, Visibility


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
        """The method as the `viewer` of the context may see it."""
        viewer = self.context["viewer"]
        profile = results.profile(method=instance, viewer=viewer)
        is_own = instance.is_named_for(viewer) and viewer.is_authenticated and methods.is_of(instance, viewer)
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
        """These, and one for each detail of the registry."""
        fields = super().get_fields()
        for detail in details.DETAILS:
            limits = detail.kind.limits
            field = serializers.ChoiceField if "choices" in limits else FIELD_OF[detail.kind.type]
            fields[detail.name] = field(**limits, required=False, allow_null=True, help_text=detail.help)
        return fields


class MovedSerializer(serializers.Serializer[RankChange]):
    """Another row of the board whose rank would change."""

    method = serializers.CharField(source="entry.method", help_text="Name of the method.")
    method_id = serializers.UUIDField(source="entry.method_id", allow_null=True, help_text=METHOD_ID)
    rank_before = serializers.IntegerField(source="entry.rank", allow_null=True, help_text="Current rank.")
    rank_after = serializers.IntegerField(allow_null=True, help_text="Rank after the publication.")


class SightSerializer(serializers.Serializer[BoardPreview]):
    """The public board of one split as it would be."""

    split = serializers.CharField(source="split.name", help_text=SPLIT)
    edition = serializers.IntegerField(source="edition.number", help_text=EDITION)
    n_ranked = serializers.IntegerField(help_text="Number of ranked rows that the board would have.")
    before = EntrySerializer(allow_null=True, help_text="The method's current public row, if any.")
    after = EntrySerializer(source="entry", help_text="The method's public row as it would be.")
    n_attempts_before = serializers.IntegerField(
        source="n_attempts_now",
        allow_null=True,
        help_text="Current attempts in the team's other public rows; null: it has none.",
    )
    moved = MovedSerializer(many=True, help_text="Other rows whose ranks would change, in board order.")


class ForeseenSerializer(serializers.Serializer[VisibilityPreview]):
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
    splits = SightSerializer(source="sights", many=True, help_text="Boards on which it has a row.")


class ShowSerializer(serializers.Serializer[Any]):
    """A method's new visibility."""

    visibility = serializers.ChoiceField(
        choices=[Visibility.ANONYMOUS, Visibility.PUBLIC], help_text="Who may see the method."
    )
    reveal_at = serializers.DateTimeField(
        required=False, allow_null=True, help_text="When an anonymous method becomes public by itself."
    )
    confirm = serializers.BooleanField(help_text="Must be true: publishing cannot be undone.")
