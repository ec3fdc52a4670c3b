"""The shapes of methods that programs see and send. A field once here stays."""

from dataclasses import asdict
from typing import Any

from rest_framework import serializers

from leaderboard import methods
from leaderboard.api.serializers import DetailsSerializer, absolute
from leaderboard.models import BoxSource, Cameras, Method, Visibility


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


class ShowSerializer(serializers.Serializer[Any]):
    """Who is to see a method."""

    visibility = serializers.ChoiceField(choices=[Visibility.ANONYMOUS, Visibility.PUBLIC])
    reveal_at = serializers.DateTimeField(
        required=False, allow_null=True, help_text="When an anonymous one turns public by itself."
    )
    confirm = serializers.BooleanField(help_text="True: it is known that this cannot be taken back.")
