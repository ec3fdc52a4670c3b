"""Serializers of boards, splits, quotas and errors. A field once here stays."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, Final

from django.conf import settings
from django.urls import reverse
from django.utils import timezone
from rest_framework import serializers

from evaluator.metrics.protocol import (
    OVERALL,
    PROTOCOLS,
    Protocol,
    TTCRange,
    known_names,
    known_ranges,
    metric_of,
    range_of,
)
from leaderboard.boards import snapshots
from leaderboard.boards.listing import Board
from leaderboard.boards.rows import ConfidenceInterval, Entry
from leaderboard.methods import details
from leaderboard.methods.details import Details
from leaderboard.models import Split, Visibility
from leaderboard.quotas import admissions
from leaderboard.quotas.usage import Quota
from leaderboard.statistics.missing_intervals import explained

SPLIT: Final = "Name of the split."
EDITION: Final = "Number of the edition."
PROTOCOL: Final = "Name of the protocol: the rules for computing scores."
DECIMALS: Final = "Decimals that the edition publishes of scores, confidence intervals and differences."
GROUND_TRUTH: Final = "Digest of the ground truth."
N_SEQUENCES: Final = "Number of sequences in the ground truth."
N_RECORDINGS: Final = "Number of recordings that the sequences come from."
UNIT: Final = "What intervals, tests and rank ranges take as independent: `recording`, `day` or `given`."
N_UNITS: Final = "Number of such units."
OPENS_AT: Final = "When submissions open; null: as soon as there is ground truth."
CLOSES_AT: Final = "When submissions close; null: never."
METHOD_ID: Final = "Id of the method; null for a result quoted from a paper."
PAPER_URL: Final = "URL of the paper."
CODE_URL: Final = "URL of the code."
DETAILS: Final = "What the method uses and costs, as stated by its team."
# For sources such as `edition.protocol`: null without an edition. Read-only, because the schema calls other
# fields with a default optional, and answers always have them.
NULLABLE: Final[dict[str, Any]] = {"default": None, "allow_null": True, "read_only": True}


class NamedSerializer(serializers.Serializer[Any]):
    """Values by the names that an edition's protocol has, in its order; required are those of every one."""

    known = staticmethod(known_names)

    @staticmethod
    def names_of(rules: Protocol) -> Iterable[str]:
        return rules.score_names

    def child(self, name: str, **options: Any) -> serializers.Field[Any, Any, Any, Any]:
        raise NotImplementedError

    def get_fields(self) -> dict[str, serializers.Field[Any, Any, Any, Any]]:
        common = set.intersection(*(set(self.names_of(rules)) for rules in PROTOCOLS.values()))
        return {name: self.child(name, required=name in common) for name in self.known()}

    def to_representation(self, instance: Mapping[str, Any]) -> dict[str, Any]:
        return {
            name: None if value is None else self.fields[name].to_representation(value)
            for name, value in instance.items()
            if name in self.fields
        }


def _sequences(ttc_range: TTCRange | None) -> str:
    return f"sequences with {ttc_range.condition}" if ttc_range else "all sequences"


class ScoresSerializer(NamedSerializer):
    """The published scores of the protocol; the board ranks by the first."""

    def child(self, name: str, **options: Any) -> serializers.FloatField:
        metric, of = metric_of(name), _sequences(range_of(name))
        text = f"{metric.title} ({metric.unit}), mean over {of}; lower is better; null: no such sequences."
        return serializers.FloatField(allow_null=True, help_text=text, **options)


class CountsSerializer(NamedSerializer):
    """Number of sequences, overall and in each TTC range."""

    known = staticmethod(lambda: (OVERALL, *known_ranges()))

    @staticmethod
    def names_of(rules: Protocol) -> Iterable[str]:
        return rules.range_names

    def child(self, name: str, **options: Any) -> serializers.IntegerField:
        counted = _sequences(known_ranges().get(name))
        return serializers.IntegerField(help_text=f"{counted[0].upper()}{counted[1:]}.", **options)


class ProblemSerializer(serializers.Serializer[Any]):
    """One problem of a file or a request."""

    code = serializers.CharField(help_text="Stable code for programs.")
    message = serializers.CharField(help_text="What is wrong, what was found and what was expected.")
    where = serializers.CharField(
        allow_blank=True,
        help_text="JSON pointer into the file (`/predictions/12`), position in it (`line 3, column 8`), "
        "name of a form field or parameter, or empty.",
    )


class WarningSerializer(serializers.Serializer[Any]):
    """A probable mistake in a file that was scored nevertheless."""

    code = serializers.CharField(help_text="Stable code for programs, listed in the guide Prediction files.")
    message = serializers.CharField(help_text="What was found, what was expected and the probable cause.")


class ErrorSerializer(serializers.Serializer[Any]):
    """RFC 9457 problem details."""

    type = serializers.CharField(help_text="URL of the explanation of the code.")
    title = serializers.CharField(help_text="Name of the HTTP status.")
    status = serializers.IntegerField(help_text="HTTP status.")
    code = serializers.CharField(help_text="Stable code for programs.")
    detail = serializers.CharField(help_text="What is wrong, what was found and what was expected.")
    problems = ProblemSerializer(many=True, help_text="Every problem found.")


class SlotsSerializer(serializers.Serializer[Quota]):
    """A team's remaining submissions to a split."""

    limit = serializers.IntegerField(allow_null=True, help_text="Submissions per window; null: no limit.")
    used = serializers.IntegerField(help_text="Submissions in the window that are scored or waiting.")
    left = serializers.IntegerField(allow_null=True, help_text="Remaining submissions; null: no limit.")
    next_slot_at = serializers.DateTimeField(
        allow_null=True,
        help_text="When the next submission is accepted; null: now, or never if the limit is 0.",
    )


class QuotaSerializer(SlotsSerializer):
    """A team's remaining submissions to a split, with the rules."""

    split = serializers.CharField(help_text=SPLIT)
    is_open = serializers.BooleanField(help_text="Whether the split and the quota accept a submission now.")
    window_s = serializers.FloatField(help_text="Length of the rolling window.")
    min_gap_s = serializers.FloatField(help_text="Minimum time between submissions.")
    rejected_used = serializers.IntegerField(
        source="n_rejected", help_text="Files rejected, or cancelled by the team, in the last 24 hours."
    )
    rejected_limit = serializers.IntegerField(
        source="rules.quota_rejected_limit",
        allow_null=True,
        help_text="Rejected and cancelled files accepted per 24 hours; null: no limit.",
    )
    sentence = serializers.CharField(help_text="The remaining quota in one sentence.")


class AccountSerializer(serializers.Serializer[Any]):
    """A token and its team."""

    team = serializers.CharField(
        source="team.name", help_text="Name of the team; null: none yet.", **NULLABLE
    )
    token = serializers.CharField(
        source="token.name", help_text="Name of the token; null: a browser's session.", **NULLABLE
    )
    scopes = serializers.ListField(
        source="token.scopes",
        child=serializers.CharField(),
        default=list,
        read_only=True,
        help_text="What the token may do: `read`, `submit`, `publish`.",
    )
    split = serializers.CharField(
        source="token.split_id", help_text="Only split that it is for; null: all.", **NULLABLE
    )
    expires_at = serializers.DateTimeField(
        source="token.expiry", help_text="When the token ends.", **NULLABLE
    )


class LeakedTokenSerializer(serializers.Serializer[Any]):
    """A leaked token."""

    token = serializers.CharField(max_length=1000, help_text="The complete token as found.")


class RevokedSerializer(serializers.Serializer[Any]):
    """The same answer for every text, whether or not it was a token."""

    detail = serializers.CharField(
        default="If that was a token of this leaderboard, it is revoked now.",
        read_only=True,
        help_text="The same sentence for every text.",
    )


class SplitSerializer(serializers.Serializer[Split]):
    """A split and its published edition."""

    split = serializers.CharField(source="name", help_text=SPLIT)
    title = serializers.CharField(help_text="Title of the split.")
    description = serializers.CharField(help_text="Description of the split.")
    is_open = serializers.SerializerMethodField(help_text="Whether the split accepts submissions.")
    is_archived = serializers.BooleanField(
        help_text="Whether the split is archived: the board stays, submissions are closed."
    )
    same_truth_as = serializers.CharField(
        source="same_truth_as_id",
        allow_null=True,
        help_text="Split whose ground truth this challenge shares; null: it has its own.",
    )
    opens_at = serializers.DateTimeField(allow_null=True, help_text=OPENS_AT)
    closes_at = serializers.DateTimeField(allow_null=True, help_text=CLOSES_AT)
    announcement = serializers.SerializerMethodField(
        help_text="Text on its pages now: the line of the site and that of the split; empty: none."
    )
    announcement_ends_at = serializers.DateTimeField(
        allow_null=True,
        help_text="When the split's own last announcement ends or ended; null: there was none.",
    )
    needs_admission = serializers.BooleanField(help_text="Whether only admitted teams may submit.")
    is_hidden = serializers.BooleanField(help_text="Whether the true values are hidden.")
    is_simulated = serializers.BooleanField(help_text="Whether the true values come from a simulation.")
    edition = serializers.IntegerField(
        source="current_edition.number",
        help_text="Number of the published edition; null: none yet.",
        **NULLABLE,
    )
    protocol = serializers.CharField(source="current_edition.protocol", help_text=PROTOCOL, **NULLABLE)
    decimals = serializers.IntegerField(source="current_edition.decimals", help_text=DECIMALS, **NULLABLE)
    ground_truth = serializers.CharField(
        source="current_edition.ground_truth_id", help_text=GROUND_TRUTH, **NULLABLE
    )
    n_sequences = serializers.IntegerField(
        source="current_edition.ground_truth.n_sequences", help_text=N_SEQUENCES, **NULLABLE
    )

    def get_announcement(self, split: Split) -> str:
        now = timezone.now()
        lines = (snapshots.site_line_of([split], now=now), split.announcement_at(now))
        return " ".join(line for line in lines if line)

    def get_is_open(self, split: Split) -> bool:
        return admissions.is_open(split, now=timezone.now())


FIELD_OF: Final[Mapping[type, type[serializers.Field[Any, Any, Any, Any]]]] = {
    str: serializers.CharField,
    int: serializers.IntegerField,
    float: serializers.FloatField,
    bool: serializers.BooleanField,
}


class DetailsSerializer(serializers.Serializer[Details]):
    """What a method uses and costs, as stated by its team; null or empty: not specified."""

    def get_fields(self) -> dict[str, serializers.Field[Any, Any, Any, Any]]:
        fields = {}
        for detail in details.DETAILS:
            empty: dict[str, Any] = {"allow_null" if detail.kind.empty is None else "allow_blank": True}
            fields[detail.name] = FIELD_OF[detail.kind.type](**empty, help_text=detail.meaning)
        return fields


class UncertaintySerializer(serializers.Serializer[ConfidenceInterval]):
    """The 95% confidence interval and rank range of one score; null where unknown."""

    low = serializers.FloatField(
        allow_null=True,
        help_text="Lower end of the 95% confidence interval; null: not computed yet, too few units, or fewer "
        "than 6 with an error.",
    )
    high = serializers.FloatField(
        allow_null=True, help_text="Upper end of the 95% confidence interval; null: as `low`."
    )
    rank_low = serializers.IntegerField(
        allow_null=True,
        help_text="Best rank of the rank range; a quoted row counts as if it had an interval as wide as this "
        "one.",
    )
    rank_high = serializers.IntegerField(allow_null=True, help_text="Worst rank of the rank range.")
    is_with_best = serializers.BooleanField(
        allow_null=True,
        help_text="Whether it may be the best of the column at 95%: `rank_low` is 1, counting quoted rows.",
    )
    reason = serializers.CharField(
        allow_blank=True,
        help_text="Why there is no interval and will be none, as pages say it; empty where there is one, or "
        "will be.",
    )


class EntrySerializer(serializers.Serializer[Entry]):
    """One row of a board."""

    rank = serializers.IntegerField(
        allow_null=True, help_text="By the first of the published scores, shared by ties; null: it has none."
    )
    id = serializers.CharField(
        help_text="Permanent id of the row: the method's id; for a quoted row `published:` and its short "
        "name, such as `published:deep-scale`."
    )
    method = serializers.CharField(help_text="Name of the method.")
    method_id = serializers.UUIDField(allow_null=True, help_text=METHOD_ID)
    team = serializers.CharField(help_text="Name of the team.")
    kind = serializers.ChoiceField(
        choices=["submission", "published"],
        help_text="A submission scored here, or a result quoted from a paper.",
    )
    visibility = serializers.ChoiceField(
        choices=Visibility.choices, help_text="Rows that are PRIVATE are visible to your team alone."
    )
    pseudonym = serializers.SerializerMethodField(
        help_text="Name that others see in your team's own anonymous row; null in every other row."
    )
    date = serializers.CharField(source="date_text", help_text="Day of the submission, or year of the paper.")
    description = serializers.CharField(allow_blank=True, help_text="Description of the method by its team.")
    paper_url = serializers.CharField(allow_blank=True, help_text=PAPER_URL)
    code_url = serializers.CharField(allow_blank=True, help_text=CODE_URL)
    source = serializers.CharField(  # type: ignore[assignment]  # the row's own name, also one of the field's
        allow_blank=True, help_text="Citation of a quoted row."
    )
    withdrawn_at = serializers.DateTimeField(
        allow_null=True, help_text="When the team withdrew the submission; it has no scores."
    )
    is_unscorable = serializers.BooleanField(
        help_text="In an earlier edition: whether the published edition cannot score this file."
    )
    details = DetailsSerializer(help_text=DETAILS)
    n_attempts = serializers.IntegerField(
        allow_null=True,
        help_text="Scored submissions of the team's public methods to the split; anonymous: of the method.",
    )
    scores = ScoresSerializer(help_text="The published scores; the board ranks by the first.")
    decimals = serializers.IntegerField(
        help_text="Decimals of the scores and their confidence intervals: as printed in the paper, else as "
        "the edition publishes."
    )
    intervals = serializers.DictField(
        child=UncertaintySerializer(),
        help_text="Confidence intervals by score name, where computed; empty unless `intervals=1`.",
    )

    def get_pseudonym(self, entry: Entry) -> str | None:
        return entry.pseudonym or None

    def to_representation(self, instance: Entry) -> dict[str, Any]:
        # Confidence intervals are most of the bytes.
        edition = self.context.get("explained_by")
        if not self.context.get("has_intervals"):
            instance = replace(instance, intervals={})
        elif edition is not None and instance.kind == "submission":
            shown = explained(instance.intervals, instance.scores, edition=edition)
            instance = replace(instance, intervals=shown)
        return super().to_representation(instance)


class BoardSerializer(serializers.Serializer[Board]):
    """The board of a split in one edition."""

    split = serializers.CharField(source="split.name", help_text=SPLIT)
    edition = serializers.IntegerField(
        source="edition.number", help_text="Number of the edition shown; null: none is published.", **NULLABLE
    )
    protocol = serializers.CharField(source="edition.protocol", help_text=PROTOCOL, **NULLABLE)
    decimals = serializers.IntegerField(source="edition.decimals", help_text=DECIMALS, **NULLABLE)
    ground_truth = serializers.CharField(source="edition.ground_truth_id", help_text=GROUND_TRUTH, **NULLABLE)
    n_sequences = serializers.IntegerField(
        source="edition.ground_truth.n_sequences", help_text=N_SEQUENCES, **NULLABLE
    )
    n_recordings = serializers.IntegerField(
        source="edition.ground_truth.n_recordings", help_text=N_RECORDINGS, **NULLABLE
    )
    unit = serializers.CharField(source="edition.unit", help_text=UNIT, **NULLABLE)
    n_units = serializers.IntegerField(source="edition.unit_count", help_text=N_UNITS, **NULLABLE)
    floor = ScoresSerializer(
        help_text="Scores of the ground truth itself, submitted as predictions: hardly any file scores "
        "lower, because the protocol truncates predictions and not the ground truth. Null: not computed yet.",
        **NULLABLE,
    )
    at = serializers.DateTimeField(allow_null=True, help_text="Time requested by `at`; null: now.")
    updated_at = serializers.DateTimeField(
        allow_null=True,
        help_text="When the newest row was added, or the edition published; the end of the day for an "
        "anonymous row.",
    )
    is_open = serializers.BooleanField(help_text="Whether the split accepts submissions.")
    opens_at = serializers.DateTimeField(source="split.opens_at", allow_null=True, help_text=OPENS_AT)
    closes_at = serializers.DateTimeField(source="split.closes_at", allow_null=True, help_text=CLOSES_AT)
    sort = serializers.CharField(help_text="Column by which the rows are sorted; `-`: descending.")
    entries = EntrySerializer(many=True, help_text="The rows in the requested order.")


def absolute(name: str, *args: object) -> str:
    """Return the permanent address of a named page."""
    return settings.SITE_URL + reverse(name, args=[str(arg) for arg in args])
