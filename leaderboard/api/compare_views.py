"""Comparisons of methods: serializers and views. A field once here stays."""

from typing import Any
from uuid import UUID

from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter, OpenApiResponse, extend_schema, extend_schema_field
from rest_framework import serializers
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from evaluator import Difference, rounded
from evaluator.tables import sentences
from leaderboard.api.authentication import require_split
from leaderboard.api.exceptions import edition_number
from leaderboard.api.schema import errors, response_header
from leaderboard.api.serializers import (
    DECIMALS,
    EDITION,
    N_UNITS,
    SPLIT,
    UNIT,
    EntrySerializer,
    NamedSerializer,
)
from leaderboard.api.views import current_split, published_edition
from leaderboard.ops import rate_limits
from leaderboard.statistics import comparisons
from leaderboard.statistics.comparisons import Compared, Pair


class DifferenceSerializer(serializers.Serializer[Difference]):
    """First minus second in one column; negative: the first is better."""

    difference = serializers.FloatField(help_text="Difference in the column's unit.")
    low = serializers.FloatField(
        allow_null=True,
        help_text="Lower end of the 95% confidence interval, rounded outwards where the ground truth is "
        "hidden; null: too few units, fewer than 6 in which the two differ (see `sentence`), or withheld.",
    )
    high = serializers.FloatField(
        allow_null=True,
        help_text="Upper end of the 95% confidence interval, rounded outwards where the ground truth is "
        "hidden; null: too few units, fewer than 6 in which the two differ (see `sentence`), or withheld.",
    )
    p = serializers.FloatField(
        allow_null=True,
        help_text="p-value of the two-sided cluster sign-flip test, four decimals; null: as `low`, "
        "or the ground truth is hidden and only `p_below` is published.",
    )
    p_below = serializers.FloatField(
        allow_null=True,
        help_text="The smallest of 0.001, 0.01 and 0.05 that p is below, else 1; null: as `low`.",
    )
    n_effective = serializers.FloatField(
        allow_null=True,
        help_text="Effective number of units in this column; below 8 there is no confidence interval "
        "and no p.",
    )
    is_significant = serializers.BooleanField(
        help_text="Whether p is below 0.05, uncorrected: among many columns and several pairs expect false "
        "positives. Where the ground truth is hidden, the interval does not say this: 0 may be an end."
    )
    detectable_difference = serializers.SerializerMethodField(
        help_text="The smallest difference that the test detects with about 80% power, an estimate; null: "
        "this one is significant, or `low` is null."
    )
    sentence = serializers.SerializerMethodField(
        help_text="The result as a sentence. Its p is uncorrected, for this column and pair alone."
    )

    def get_detectable_difference(self, difference: Difference) -> float | None:
        return rounded(difference.detectable_difference, decimals=self.context["decimals"])

    def get_sentence(self, difference: Difference) -> str:
        return sentences.sentence(
            **self.context["names"],
            name=self.field_name or "",
            difference=difference,
            decimals=self.context["decimals"],
            withheld=self.context["withheld"],
        )


class DifferencesSerializer(NamedSerializer):
    """A difference for each score."""

    def child(self, name: str, **options: Any) -> DifferenceSerializer:
        text = "Null: one of the two has no score in this column."
        return DifferenceSerializer(allow_null=True, help_text=text, **options)


class PairSerializer(serializers.Serializer[Pair]):
    """A pair of the methods."""

    first = serializers.UUIDField(source="first.method_id", help_text="Id of the first method.")
    second = serializers.UUIDField(source="second.method_id", help_text="Id of the second method.")
    differences = serializers.SerializerMethodField(
        help_text="First minus second, by score name; null until computed."
    )
    sentence = serializers.SerializerMethodField(
        help_text="The difference in the score that ranks as a sentence; empty until computed."
    )
    withheld = serializers.CharField(
        allow_blank=True,
        help_text="Why only the difference of the published scores is available for this pair; else empty.",
    )

    @extend_schema_field(DifferencesSerializer(allow_null=True))
    def get_differences(self, pair: Pair) -> dict[str, Any] | None:
        if pair.differences is None:
            return None
        by_score = {name: pair.differences.get(name) for name in pair.first.scores}
        names = {"first": pair.first.method, "second": pair.second.method}
        context = {"names": names, "decimals": pair.first.decimals, "withheld": pair.withheld}
        return dict(DifferencesSerializer(by_score, context=context).data)

    def get_sentence(self, pair: Pair) -> str:
        return pair.sentence()


class ComparedSerializer(serializers.Serializer[Compared]):
    """Two to five methods of one board side by side."""

    split = serializers.CharField(source="split.name", help_text=SPLIT)
    edition = serializers.IntegerField(source="edition.number", help_text=EDITION)
    decimals = serializers.IntegerField(source="edition.decimals", help_text=DECIMALS)
    unit = serializers.CharField(source="edition.unit", help_text=UNIT)
    n_units = serializers.IntegerField(source="edition.unit_count", help_text=N_UNITS)
    is_complete = serializers.BooleanField(
        help_text="Whether every pair is computed; if not, repeat the request after Retry-After seconds."
    )
    reason = serializers.CharField(help_text="Why there are no confidence intervals, if there are none.")
    entries = EntrySerializer(many=True, help_text="The methods' rows, in the requested order.")
    pairs = PairSerializer(many=True, help_text="Every pair of them.")


RETRY_AFTER_S = 2


class CompareView(APIView):
    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="compare",
        parameters=[
            OpenApiParameter("split", str, required=True, description="Name of the split."),
            OpenApiParameter("m", UUID, many=True, required=True, description="Ids of two to five methods."),
            OpenApiParameter(
                "edition", int, description="Number of a published edition; default: the current."
            ),
            response_header("Retry-After", int, "Seconds after which to ask for the rest.", statuses=[202]),
        ],
        responses={
            200: ComparedSerializer,
            202: OpenApiResponse(
                ComparedSerializer, "Partial: the rest is being computed; repeat after Retry-After seconds."
            ),
            **errors(400, 404, 429),
        },
    )
    def get(self, request: Request) -> Response:
        """Compare two to five methods: differences, confidence intervals and p-values; 202 until complete."""
        name, number = (request.query_params.get(key, "") for key in ("split", "edition"))
        require_split(request.auth, name)  # authentication does so for splits in the path alone
        split = current_split(request, name)
        compared = comparisons.compare(
            methods=[comparisons.method_id(text) for text in request.query_params.getlist("m")],
            split=split,
            viewer=request.user,
            now=timezone.now(),
            address=rate_limits.address_of(request),
            edition=published_edition(split, edition_number(number)) if number else None,
        )
        data = ComparedSerializer(compared).data
        if compared.is_complete:
            return Response(data)
        return Response(data, status=202, headers={"Retry-After": str(RETRY_AFTER_S)})
