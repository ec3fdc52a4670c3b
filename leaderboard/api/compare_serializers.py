"""The shapes of comparisons."""

from typing import Any

from drf_spectacular.utils import extend_schema_field
from rest_framework import serializers

from evaluator import Difference, published, sentences
from evaluator.protocol import SCORE_NAMES
from leaderboard.api.serializers import EntrySerializer
from leaderboard.comparisons import Compared, Pair


class DifferenceSerializer(serializers.Serializer[Difference]):
    """First minus second in one column; below 0 the first is better."""

    difference = serializers.FloatField(help_text="In the column's unit.")
    low = serializers.FloatField(
        allow_null=True,
        help_text="Lower end of its 95 % confidence interval; null: too few recordings, or not told of "
        "this pair.",
    )
    high = serializers.FloatField(
        allow_null=True,
        help_text="Upper end of its 95 % confidence interval; null: too few recordings, or not told of "
        "this pair.",
    )
    p = serializers.FloatField(
        allow_null=True,
        help_text="Of the two-sided cluster sign-flip test, four decimals; null: too few recordings, not "
        "told of this pair, or the ground truth is hidden, and `p_below` says what is told.",
    )
    p_below = serializers.FloatField(
        allow_null=True,
        help_text="The smallest of 0.001, 0.01 and 0.05 that p is below, else 1; null: too few recordings, "
        "or not told of this pair.",
    )
    n_effective = serializers.FloatField(
        allow_null=True,
        help_text="Effective number of recordings in this column; below 8 there is no interval and no p.",
    )
    is_significant = serializers.BooleanField(
        help_text="Whether p, as it was computed, is below 0.05; of ten columns and several pairs, some are "
        "by chance."
    )
    detectable_difference = serializers.SerializerMethodField(
        help_text="The smallest difference that four of five such tests would have found (80 % power); null: "
        "this one is significant, or there are too few recordings."
    )
    sentence = serializers.SerializerMethodField(
        help_text="What it means, in words. Its p is of this column and pair alone, whatever else one asks."
    )

    def get_detectable_difference(self, found: Difference) -> float | None:
        """Rounded as differences are."""
        return published(found.detectable_difference, decimals=self.context["decimals"])

    def get_sentence(self, found: Difference) -> str:
        """Of this column."""
        return sentences.sentence(
            **self.context["names"],
            name=self.field_name or "",
            found=found,
            decimals=self.context["decimals"],
            withheld=self.context["withheld"],
        )


class DifferencesSerializer(serializers.Serializer[Any]):
    """A difference for each of the ten names."""

    def get_fields(self) -> dict[str, serializers.Field[Any, Any, Any, Any]]:
        """One nullable difference for each."""
        text = "Null: one of the two has no value in this column."
        return {name: DifferenceSerializer(allow_null=True, help_text=text) for name in SCORE_NAMES}


class PairSerializer(serializers.Serializer[Pair]):
    """Two of the methods."""

    first = serializers.UUIDField(source="first.method_id", help_text="Id of the one method.")
    second = serializers.UUIDField(source="second.method_id", help_text="Id of the other.")
    differences = serializers.SerializerMethodField(
        help_text="First minus second, by column; null while a worker computes it."
    )
    sentence = serializers.SerializerMethodField(
        help_text="What the difference in MiD means, in words; empty while it is computed."
    )
    withheld = serializers.CharField(
        allow_blank=True,
        help_text="Why nothing but the difference of the published values is told of these two; else empty.",
    )

    @extend_schema_field(DifferencesSerializer(allow_null=True))
    def get_differences(self, pair: Pair) -> dict[str, Any] | None:
        """All ten names, once they are computed."""
        if pair.differences is None:
            return None
        found = {name: pair.differences.get(name) for name in SCORE_NAMES}
        names = {"first": pair.first.method, "second": pair.second.method}
        context = {"names": names, "decimals": pair.first.decimals, "withheld": pair.withheld}
        return dict(DifferencesSerializer(found, context=context).data)

    def get_sentence(self, pair: Pair) -> str:
        """Of the overall MiD."""
        return pair.sentence()


class ComparedSerializer(serializers.Serializer[Compared]):
    """Two to five methods of one board side by side."""

    split = serializers.CharField(source="split.name", help_text="Name of the split.")
    edition = serializers.IntegerField(source="edition.number", help_text="Number of the edition.")
    decimals = serializers.IntegerField(
        source="edition.decimals", help_text="With how many decimals the edition publishes."
    )
    is_complete = serializers.BooleanField(
        help_text="Whether every pair is computed; if not, ask again after Retry-After seconds."
    )
    reason = serializers.CharField(help_text="Why there are no intervals, where there are none.")
    entries = EntrySerializer(many=True, help_text="The methods' rows, in the order asked for.")
    pairs = PairSerializer(many=True, help_text="Every two of them.")
