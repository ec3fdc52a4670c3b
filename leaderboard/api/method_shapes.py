"""The shapes of methods that programs see and send. A field once here stays."""

from dataclasses import asdict
from typing import Any

from rest_framework import serializers

from leaderboard import methods
from leaderboard.api.serializers import DetailsSerializer, EntrySerializer, absolute
from leaderboard.models import BoxSource, Cameras, Method, Visibility
from leaderboard.visibility import Moved, Preview, Sight, notice_of


class MethodSerializer(serializers.Serializer[Method]):
    """A method as the reader may see it. Where `is_named` is false, it is anonymous to them."""

    id = serializers.UUIDField()
    name = serializers.CharField(help_text="Of an anonymous one its pseudonym.")
    team = serializers.CharField()
    visibility = serializers.ChoiceField(choices=Visibility.choices)
    is_named = serializers.BooleanField()
    pseudonym = serializers.CharField(allow_null=True, help_text="What others call it; for its team alone.")
    description = serializers.CharField(allow_blank=True)
    paper_url = serializers.CharField(allow_blank=True)
    code_url = serializers.CharField(allow_blank=True)
    details = DetailsSerializer()
    shown_at = serializers.DateTimeField(allow_null=True, help_text="For its team alone.")
    reveal_at = serializers.DateTimeField(allow_null=True, help_text="For its team alone.")
    notice = serializers.CharField(
        allow_blank=True,
        help_text="Who sees its results, in a sentence; empty if it is private. For its team alone.",
    )
    url = serializers.URLField(help_text="The method's page.")
    api_url = serializers.URLField()

    def to_representation(self, instance: Method) -> dict[str, Any]:
        """The method as `viewer` in the context is told of it."""
        viewer = self.context["viewer"]
        profile = methods.profile(method=instance, viewer=viewer)
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
            "details": asdict(profile.details),
            "shown_at": instance.shown_at if is_own else None,
            "reveal_at": instance.reveal_at if is_own else None,
            "notice": notice_of(instance) if is_own else "",
            "url": absolute("method", instance.pk),
            "api_url": absolute("api-method", instance.pk),
        }


class MethodChangesSerializer(serializers.Serializer[Any]):
    """What can be said of a method. What is not named stays; null takes back what was said."""

    name = serializers.CharField(required=False, max_length=80, help_text="Stays once it is public.")
    description = serializers.CharField(required=False, allow_null=True, max_length=2000)
    paper_url = serializers.CharField(required=False, allow_null=True, max_length=500)
    code_url = serializers.CharField(required=False, allow_null=True, max_length=500)
    n_frames = serializers.IntegerField(required=False, allow_null=True, min_value=2, max_value=6)
    cameras = serializers.ChoiceField(choices=Cameras.choices, required=False, allow_null=True)
    box_source = serializers.ChoiceField(choices=BoxSource.choices, required=False, allow_null=True)
    uses_nerf = serializers.BooleanField(required=False, allow_null=True)
    uses_extra_data = serializers.BooleanField(required=False, allow_null=True)
    pretraining = serializers.CharField(required=False, allow_null=True, max_length=200)
    n_parameters = serializers.IntegerField(
        required=False, allow_null=True, min_value=1, max_value=methods.MAX_PARAMETERS
    )
    latency_ms = serializers.FloatField(
        required=False, allow_null=True, help_text="Above 0; needs `hardware`, what it was measured on."
    )
    hardware = serializers.CharField(required=False, allow_null=True, max_length=120)


class MovedSerializer(serializers.Serializer[Moved]):
    """Another row of a board, whose rank would change."""

    method = serializers.CharField(source="entry.method")
    method_id = serializers.UUIDField(source="entry.method_id", allow_null=True)
    rank_before = serializers.IntegerField(source="entry.rank", allow_null=True, help_text="Its rank now.")
    rank_after = serializers.IntegerField(allow_null=True, help_text="Its rank then.")


class SightSerializer(serializers.Serializer[Sight]):
    """The board of one split as everybody would see it."""

    split = serializers.CharField(source="split.name")
    edition = serializers.IntegerField(source="edition.number", help_text="Number of its published edition.")
    n_ranked = serializers.IntegerField(help_text="Rows with a rank that the board would have.")
    before = EntrySerializer(allow_null=True, help_text="The method's row as everybody sees it now, if any.")
    after = EntrySerializer(source="entry", help_text="Its row as everybody would see it then.")
    n_attempts_before = serializers.IntegerField(
        source="n_attempts_now",
        allow_null=True,
        help_text="Attempts that the team's other public rows tell of now; null: there are none.",
    )
    moved = MovedSerializer(many=True, help_text="Other rows whose ranks would change, in their order.")


class ForeseenSerializer(serializers.Serializer[Preview]):
    """What everybody would see of a method. Asking changes nothing."""

    visibility = serializers.ChoiceField(choices=[Visibility.ANONYMOUS, Visibility.PUBLIC])
    name = serializers.CharField(source="profile.name", help_text="If anonymous its pseudonym.")
    team = serializers.CharField(source="profile.team")
    description = serializers.CharField(source="profile.description", allow_blank=True)
    paper_url = serializers.CharField(source="profile.paper_url", allow_blank=True)
    code_url = serializers.CharField(source="profile.code_url", allow_blank=True)
    details = DetailsSerializer(source="profile.details")
    splits = SightSerializer(source="sights", many=True, help_text="Boards on which it has a row.")


class ShowSerializer(serializers.Serializer[Any]):
    """Who is to see a method."""

    visibility = serializers.ChoiceField(choices=[Visibility.ANONYMOUS, Visibility.PUBLIC])
    reveal_at = serializers.DateTimeField(
        required=False, allow_null=True, help_text="When an anonymous one turns public by itself."
    )
    confirm = serializers.BooleanField(help_text="True: it is known that this cannot be taken back.")
