"""The shapes that programs see. A field once here stays."""

from dataclasses import replace
from typing import Any

from django.conf import settings
from django.urls import reverse
from django.utils import timezone
from rest_framework import serializers

from evaluator.protocol import INTERVAL_NAMES, SCORE_NAMES
from leaderboard import deadlines, preview, rescoring
from leaderboard.entries import Details, Entry, Interval
from leaderboard.models import Edition, Publication, Split, Visibility
from leaderboard.quotas import Quota
from leaderboard.standings import Board

_DECIMALS = "With how many decimals the edition publishes values, intervals and differences."


class ScoresSerializer(serializers.Serializer[Any]):
    """The ten published numbers: MiD in 10⁻⁴, RTE in percent."""

    def get_fields(self) -> dict[str, serializers.Field[Any, Any, Any, Any]]:
        """One nullable number for each of the ten names."""
        return {name: serializers.FloatField(allow_null=True) for name in SCORE_NAMES}


class CountsSerializer(serializers.Serializer[Any]):
    """Sequences overall and per interval."""

    def get_fields(self) -> dict[str, serializers.Field[Any, Any, Any, Any]]:
        """One count for each interval."""
        return {name: serializers.IntegerField() for name in INTERVAL_NAMES}


class ProblemSerializer(serializers.Serializer[Any]):
    """One fault of a file."""

    code = serializers.CharField()
    message = serializers.CharField()
    where = serializers.CharField(allow_blank=True)


class WarningSerializer(serializers.Serializer[Any]):
    """What is probably wrong with a file that was scored all the same."""

    code = serializers.CharField()
    message = serializers.CharField()


class ErrorSerializer(serializers.Serializer[Any]):
    """RFC 9457 problem details."""

    type = serializers.CharField()
    title = serializers.CharField()
    status = serializers.IntegerField()
    code = serializers.CharField()
    detail = serializers.CharField()
    problems = ProblemSerializer(many=True)


class SlotsSerializer(serializers.Serializer[Quota]):
    """What the team has left on a split."""

    limit = serializers.IntegerField(
        allow_null=True, help_text="Submissions within the window; null: any number."
    )
    used = serializers.IntegerField(help_text="Scored or waiting, within the window.")
    left = serializers.IntegerField(allow_null=True)
    next_slot_at = serializers.DateTimeField(
        allow_null=True, help_text="When the next submission is taken; null: now, or never if the limit is 0."
    )


class QuotaSerializer(SlotsSerializer):
    """What the team has left on one of the splits, with the rules."""

    split = serializers.CharField()
    is_open = serializers.BooleanField(help_text="Whether the split and the quota let a submission in now.")
    window_s = serializers.FloatField(source="rules.window_s", help_text="The rolling window.")
    min_gap_s = serializers.FloatField(
        source="rules.min_gap_s", help_text="Least time between two submissions."
    )
    rejected_used = serializers.IntegerField(
        source="n_rejected",
        help_text="Files of the last 24 hours that were rejected, or cancelled by the team.",
    )
    rejected_limit = serializers.IntegerField(source="rules.rejected_limit", allow_null=True)
    sentence = serializers.CharField(help_text="The same in words.")


class LeakedTokenSerializer(serializers.Serializer[Any]):
    """A token that leaked."""

    token = serializers.CharField(max_length=1000, help_text="The whole token, as it was found.")


class RevokedSerializer(serializers.Serializer[Any]):
    """The same for every token, whether it was one or not."""

    detail = serializers.CharField(default="If that was a token of this leaderboard, it is revoked now.")


class SplitSerializer(serializers.Serializer[Split]):
    """A split and what may be done with it."""

    split = serializers.CharField(source="name")
    title = serializers.CharField()
    description = serializers.CharField()
    is_open = serializers.SerializerMethodField(help_text="Whether it takes submissions.")
    opens_at = serializers.DateTimeField(allow_null=True)
    closes_at = serializers.DateTimeField(allow_null=True)
    needs_admission = serializers.BooleanField(help_text="Whether it takes files of admitted teams alone.")
    is_hidden = serializers.BooleanField()
    is_simulated = serializers.BooleanField()
    edition = serializers.IntegerField(source="published_edition.number", default=None, allow_null=True)
    protocol = serializers.CharField(source="published_edition.protocol", default=None, allow_null=True)
    decimals = serializers.IntegerField(
        source="published_edition.decimals", default=None, allow_null=True, help_text=_DECIMALS
    )
    ground_truth = serializers.CharField(
        source="published_edition.ground_truth_id", default=None, allow_null=True
    )
    n_sequences = serializers.IntegerField(
        source="published_edition.ground_truth.n_sequences", default=None, allow_null=True
    )

    def get_is_open(self, split: Split) -> bool:
        """Whether there is ground truth, and this is the time."""
        return deadlines.is_open(split, now=timezone.now())


class DetailsSerializer(serializers.Serializer[Details]):
    """What a method uses and costs, as its team says; null or empty where nothing was said."""

    n_frames = serializers.IntegerField(allow_null=True, help_text="Frames used, 2 to 6.")
    cameras = serializers.CharField(allow_blank=True, help_text="ONE or SEVERAL.")
    box_source = serializers.CharField(allow_blank=True, help_text="GIVEN, DETECTED or NONE.")
    uses_nerf = serializers.BooleanField(allow_null=True)
    uses_extra_data = serializers.BooleanField(allow_null=True)
    pretraining = serializers.CharField(allow_blank=True)
    n_parameters = serializers.IntegerField(allow_null=True)
    latency_ms = serializers.FloatField(allow_null=True)
    hardware = serializers.CharField(allow_blank=True)


class UncertaintySerializer(serializers.Serializer[Interval]):
    """The confidence interval of one value and its rank range, at 95 %; null where they are not known."""

    low = serializers.FloatField(allow_null=True, help_text="Lower end of the 95 % confidence interval.")
    high = serializers.FloatField(allow_null=True, help_text="Its upper end.")
    rank_low = serializers.IntegerField(
        allow_null=True, help_text="The rank range in this column: its best rank."
    )
    rank_high = serializers.IntegerField(allow_null=True, help_text="Its worst rank.")
    is_with_best = serializers.BooleanField(
        allow_null=True,
        help_text="May be the best of the column at 95 %: `rank_low` is 1, rows quoted from papers counted.",
    )


class EntrySerializer(serializers.Serializer[Entry]):
    """One row of a board."""

    rank = serializers.IntegerField(allow_null=True)
    method = serializers.CharField()
    method_id = serializers.UUIDField(allow_null=True)
    team = serializers.CharField()
    kind = serializers.ChoiceField(choices=["submission", "published"])
    visibility = serializers.ChoiceField(
        choices=Visibility.choices, help_text="PRIVATE rows are your team's: nobody else's board has them."
    )
    pseudonym = serializers.SerializerMethodField(
        help_text="Of your team's own anonymous row: what everybody else reads in place of its name."
    )
    date = serializers.CharField(source="date_text")
    description = serializers.CharField(allow_blank=True)
    paper_url = serializers.CharField(allow_blank=True)
    code_url = serializers.CharField(allow_blank=True)
    source = serializers.CharField(  # type: ignore[assignment]  # the row's own name, also one of the field's
        allow_blank=True, help_text="The citation of a published row."
    )
    withdrawn_at = serializers.DateTimeField(allow_null=True, help_text="The team withdrew it: no values.")
    is_unscorable = serializers.BooleanField(
        help_text="In a former edition: the published one's ground truth cannot score this file."
    )
    details = DetailsSerializer()
    n_attempts = serializers.IntegerField(
        allow_null=True,
        help_text="Scored submissions of the team's public methods to the split; anonymous: its own.",
    )
    scores = ScoresSerializer()
    decimals = serializers.IntegerField(
        help_text="With how many decimals its values are printed: those of a paper as they were, all others "
        "and their intervals as the edition publishes."
    )
    intervals = serializers.DictField(
        child=UncertaintySerializer(),
        help_text="By the names of the scores, where they are computed; empty unless `intervals=1`.",
    )

    def get_pseudonym(self, entry: Entry) -> str | None:
        """Null for every row that the reader does not see under another name than others."""
        return entry.pseudonym or None

    def to_representation(self, instance: Entry) -> dict[str, Any]:
        """The row; its intervals, which are most of its bytes, for who asks."""
        if instance.intervals and not self.context.get("has_intervals"):
            instance = replace(instance, intervals={})
        return super().to_representation(instance)


class BoardSerializer(serializers.Serializer[Board]):
    """A ranked board: one split in one edition."""

    split = serializers.CharField(source="split.name")
    edition = serializers.IntegerField(source="edition.number", default=None, allow_null=True)
    protocol = serializers.CharField(source="edition.protocol", default=None, allow_null=True)
    decimals = serializers.IntegerField(
        source="edition.decimals", default=None, allow_null=True, help_text=_DECIMALS
    )
    ground_truth = serializers.CharField(source="edition.ground_truth_id", default=None, allow_null=True)
    n_sequences = serializers.IntegerField(
        source="edition.ground_truth.n_sequences", default=None, allow_null=True
    )
    n_recordings = serializers.IntegerField(
        source="edition.ground_truth.n_recordings", default=None, allow_null=True
    )
    floor = ScoresSerializer(
        source="edition.floor",
        default=None,
        allow_null=True,
        help_text="The scores of the ground truth itself, submitted as predictions: no file scores lower, "
        "because the protocol truncates predictions and not the ground truth. Null: not computed yet.",
    )
    at = serializers.DateTimeField(allow_null=True, help_text="The time that was asked for, if any.")
    updated_at = serializers.DateTimeField(allow_null=True)
    is_open = serializers.BooleanField(help_text="Whether its split takes submissions.")
    opens_at = serializers.DateTimeField(source="split.opens_at", allow_null=True)
    closes_at = serializers.DateTimeField(source="split.closes_at", allow_null=True)
    sort = serializers.CharField()
    entries = EntrySerializer(many=True)


class EditionSerializer(serializers.Serializer[Edition]):
    """An edition that was published: the frame of a ranking, quotable for ever."""

    split = serializers.CharField(source="split_id")
    edition = serializers.IntegerField(source="number")
    protocol = serializers.CharField()
    decimals = serializers.IntegerField(help_text=_DECIMALS)
    ground_truth = serializers.CharField(source="ground_truth_id")
    manifest = serializers.CharField(source="ground_truth.manifest_digest")
    n_sequences = serializers.IntegerField(source="ground_truth.n_sequences")
    n_recordings = serializers.IntegerField(source="ground_truth.n_recordings")
    published_at = serializers.DateTimeField()
    is_board = serializers.SerializerMethodField(help_text="Whether it is the board now.")
    url = serializers.SerializerMethodField()

    def get_is_board(self, edition: Edition) -> bool:
        """Whether the split points at it."""
        return edition.split.published_edition_id == edition.pk

    def get_url(self, edition: Edition) -> str:
        """Its permanent page."""
        return absolute("edition", edition.split_id, edition.number)


class PublicationSerializer(serializers.Serializer[Publication]):
    """One line of a split's public changelog."""

    at = serializers.DateTimeField()
    kind = serializers.CharField()
    edition = serializers.IntegerField(source="edition.number")
    replaced = serializers.IntegerField(source="replaced.number", default=None, allow_null=True)
    reason = serializers.CharField()
    n_left_out = serializers.SerializerMethodField()

    def get_n_left_out(self, publication: Publication) -> int:
        """How many submissions were knowingly left out: unfinished, or rejected and scored before."""
        return len(publication.left_out)


class RescoringSerializer(serializers.Serializer[rescoring.Progress]):
    """How far the re-scoring of an edition is."""

    n_total = serializers.IntegerField()
    n_done = serializers.IntegerField()
    n_waiting = serializers.IntegerField()
    n_scored = serializers.IntegerField()
    n_rejected = serializers.IntegerField()
    n_failed = serializers.IntegerField(help_text="By our fault.")
    n_cancelled = serializers.IntegerField()
    percent = serializers.IntegerField()
    rate_per_s = serializers.FloatField(allow_null=True)
    left_s = serializers.FloatField(allow_null=True)


class PreviewSerializer(serializers.Serializer[preview.Preview]):
    """What publishing an edition would change."""

    edition = serializers.IntegerField(source="edition.number")
    replaces = serializers.IntegerField()
    n_added = serializers.IntegerField(source="truth.n_added", default=None, allow_null=True)
    n_removed = serializers.IntegerField(source="truth.n_removed", default=None, allow_null=True)
    n_changed_sequences = serializers.IntegerField(source="truth.n_changed", default=None, allow_null=True)
    n_renumbered = serializers.IntegerField(source="truth.n_renumbered", default=None, allow_null=True)
    n_changed = serializers.IntegerField()
    n_moved = serializers.IntegerField()
    n_newly_rejected = serializers.IntegerField()
    progress = RescoringSerializer()
    changes = serializers.SerializerMethodField()

    def get_changes(self, found: preview.Preview) -> list[dict[str, Any]]:
        """One flat row for each submission."""
        return preview.rows(found)


def absolute(name: str, *args: object) -> str:
    """The quotable address of a named page."""
    return settings.SITE_URL + reverse(name, args=[str(arg) for arg in args])
