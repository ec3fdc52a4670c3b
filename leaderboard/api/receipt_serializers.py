"""Serializers of score receipts, as `evaluator.receipts` defines them."""

from typing import Any

from rest_framework import serializers

from leaderboard.api.serializers import (
    EDITION,
    GROUND_TRUTH,
    PROTOCOL,
    SPLIT,
    CountsSerializer,
    NamedSerializer,
)


class ReceiptScoresSerializer(NamedSerializer):
    """The published scores as decimal texts."""

    def child(self, name: str, **options: Any) -> serializers.CharField:
        """The text of one score."""
        text = "Score with the edition's decimals; null: the TTC range has no sequence."
        return serializers.CharField(allow_null=True, help_text=text, **options)


class ReceiptCountsSerializer(CountsSerializer):
    """Number of sequences, overall and in each TTC range."""

    def child(self, name: str, **options: Any) -> serializers.IntegerField:
        """One count."""
        return serializers.IntegerField(help_text="Number of sequences behind the mean.", **options)


class ReceiptMethodSerializer(serializers.Serializer[Any]):
    """The method as its team names it."""

    id = serializers.UUIDField(help_text="Id of the method.")
    name = serializers.CharField(help_text="Its real name when the receipt was signed, even if anonymous.")


class ReceiptSerializer(serializers.Serializer[Any]):
    """A signed score. Keep the file unchanged: every change except spacing invalidates the signature."""

    kind = serializers.CharField(help_text="Always `tsttc-score-receipt`.")
    version = serializers.IntegerField(help_text="Version of the receipt format.")
    site = serializers.CharField(help_text="URL of the leaderboard that signed it.")
    key_id = serializers.CharField(help_text="RFC 7638 thumbprint of the signing key.")
    submission = serializers.UUIDField(help_text="Id of the submission.")
    split = serializers.CharField(help_text=SPLIT)
    edition = serializers.IntegerField(help_text=EDITION)
    protocol = serializers.CharField(help_text=PROTOCOL)
    ground_truth = serializers.CharField(help_text=GROUND_TRUTH)
    file = serializers.CharField(help_text="Digest of the prediction file's bytes.")
    method = ReceiptMethodSerializer(help_text="The method.")
    scores = ReceiptScoresSerializer(help_text="The published scores.")
    counts = ReceiptCountsSerializer(help_text="Number of sequences behind each mean.")
    scored_at = serializers.DateTimeField(help_text="When it was scored, UTC.")
    signature = serializers.CharField(help_text="Ed25519, base64url, over the canonical form of the rest.")
