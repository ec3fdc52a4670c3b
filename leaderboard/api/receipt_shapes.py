"""The shape of a score receipt, as `evaluator.receipts` has it."""

from typing import Any

from rest_framework import serializers

from evaluator.protocol import INTERVAL_NAMES, SCORE_NAMES


class ReceiptScoresSerializer(serializers.Serializer[Any]):
    """The ten published numbers as decimal texts."""

    def get_fields(self) -> dict[str, serializers.Field[Any, Any, Any, Any]]:
        """One nullable text for each of the ten names."""
        text = "With the edition's decimals; null where the interval has no sequence."
        return {name: serializers.CharField(allow_null=True, help_text=text) for name in SCORE_NAMES}


class ReceiptCountsSerializer(serializers.Serializer[Any]):
    """Sequences overall and per interval."""

    def get_fields(self) -> dict[str, serializers.Field[Any, Any, Any, Any]]:
        """One count for each interval."""
        text = "Sequences that the score is the mean over."
        return {name: serializers.IntegerField(help_text=text) for name in INTERVAL_NAMES}


class ReceiptMethodSerializer(serializers.Serializer[Any]):
    """The method as its team names it."""

    id = serializers.UUIDField(help_text="The method's id.")
    name = serializers.CharField(help_text="Its name when the receipt was given, also where others see none.")


class ReceiptSerializer(serializers.Serializer[Any]):
    """A signed score. Keep the file as it is: any change but to its spacing is found out."""

    kind = serializers.CharField(help_text="Always `tsttc-score-receipt`.")
    version = serializers.IntegerField(help_text="Version of the receipt's form.")
    site = serializers.CharField(help_text="Address of the leaderboard that gave it.")
    key_id = serializers.CharField(help_text="RFC 7638 thumbprint of the key that signed it.")
    submission = serializers.UUIDField(help_text="The submission's id.")
    split = serializers.CharField(help_text="Name of the split.")
    edition = serializers.IntegerField(help_text="Number of the edition in which the score stands.")
    protocol = serializers.CharField(help_text="Name of the protocol that the numbers follow.")
    ground_truth = serializers.CharField(help_text="Digest of the ground truth.")
    file = serializers.CharField(help_text="Digest of the prediction file's bytes.")
    method = ReceiptMethodSerializer(help_text="Which method it is.")
    scores = ReceiptScoresSerializer(help_text="The published values.")
    counts = ReceiptCountsSerializer(help_text="How many sequences each is the mean over.")
    scored_at = serializers.DateTimeField(help_text="When it was scored, UTC.")
    signature = serializers.CharField(help_text="Ed25519, base64url, over the canonical form of the rest.")
