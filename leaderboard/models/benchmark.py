"""Splits, ground truths, editions, and published results."""

from datetime import UTC, datetime
from typing import ClassVar, Self

from django.core.exceptions import ValidationError
from django.db import connection, models
from django.db.models import Q
from django.utils import timezone

from evaluator.metrics.protocol import TTC_RANGES, Protocol, get_protocol
from leaderboard.models.people import User
from leaderboard.models.quotas import QuotaRules
from leaderboard.models.units import UnitOfInference

# Of quoted rows that stand since their split exists: before any time that a board can sensibly be asked for.
SINCE_EVER = datetime(1970, 1, 1, tzinfo=UTC)


NO_END = "The announcement has no end; expected an end beside its text."
NO_TEXT = "The announcement has no text; expected a text beside its end."


class Listing(models.TextChoices):
    LISTED = "LISTED", "listed"
    ARCHIVED = "ARCHIVED", "archived"
    OFF = "OFF", "switched off"


class SplitQuerySet(models.QuerySet["Split"]):
    def shown(self) -> Self:
        """Return splits that are not switched off."""
        return self.exclude(listing=Listing.OFF)

    def lock_shared(self, name: str) -> "Split":
        """Lock the split in shared mode until the transaction ends.

        A submission locks it so and a change of editions locks it alone: no submission can slip between
        an edition's opening and its list of what to score.
        """
        if connection.features.has_select_for_update:
            with connection.cursor() as cursor:
                cursor.execute("SELECT 1 FROM leaderboard_split WHERE name = %s FOR SHARE", [name])
        # SQLite has one writer at a time, which holds everything alone.
        return self.get(pk=name)


class Split(QuotaRules):
    """A part of the dataset with its policy and board."""

    name = models.SlugField(max_length=32, primary_key=True)
    title = models.CharField(max_length=80)
    description = models.TextField(blank=True)
    position = models.PositiveSmallIntegerField(default=0, help_text="Order in which splits are listed.")
    is_hidden = models.BooleanField(
        default=True, help_text="Hidden ground truth: nothing finer than means over TTC ranges is shown."
    )
    is_simulated = models.BooleanField(default=False, help_text="Ground truth made by a simulation.")
    needs_admission = models.BooleanField(
        default=False, help_text="Only teams that a maintainer has admitted submit to it."
    )
    how_to_be_admitted = models.CharField(
        max_length=300,
        blank=True,
        help_text="How a team asks for it, as the end of a sentence, like “write to …”.",
    )
    listing = models.CharField(
        max_length=8,
        choices=Listing,
        default=Listing.LISTED,
        help_text="Archived: its board stays, and it takes no submissions. "
        "Switched off: it is on no page, in no form and in no list of the API.",
    )
    same_truth_as = models.ForeignKey(
        "self",
        null=True,
        blank=True,
        on_delete=models.PROTECT,
        related_name="challenges",
        help_text="The split whose ground truth it shares: a challenge with its own dates and quota.",
    )
    opens_at = models.DateTimeField(null=True, blank=True)
    closes_at = models.DateTimeField(null=True, blank=True)
    announcement = models.CharField(
        max_length=300, blank=True, help_text="One line of plain text on its pages, until it ends."
    )
    announcement_ends_at = models.DateTimeField(null=True, blank=True)
    decimals = models.PositiveSmallIntegerField(
        default=1,
        choices=[(1, "one"), (2, "two")],
        help_text="With how many decimals its next edition publishes. Each one tells more of hidden values.",
    )
    current_edition = models.ForeignKey(
        "Edition", null=True, blank=True, on_delete=models.PROTECT, related_name="+"
    )

    objects: ClassVar[SplitQuerySet] = SplitQuerySet.as_manager()  # type: ignore[assignment]  # a manager, by its own words

    class Meta:
        ordering = ["position", "name"]
        constraints = [
            models.CheckConstraint(condition=models.Q(decimals__in=[1, 2]), name="split_decimals_one_or_two"),
            *QuotaRules.Meta.constraints,
            models.CheckConstraint(
                condition=Q(opens_at=None) | Q(closes_at=None) | Q(opens_at__lt=models.F("closes_at")),
                name="split_opens_before_it_closes",
            ),
            models.CheckConstraint(
                condition=Q(announcement="", announcement_ends_at=None)
                | (~Q(announcement="") & Q(announcement_ends_at__isnull=False)),
                name="split_announcement_has_an_end",
            ),
            models.CheckConstraint(condition=~Q(title=""), name="split_has_a_title"),
            models.CheckConstraint(condition=Q(listing__in=Listing.values), name="split_listing_is_known"),
            models.CheckConstraint(
                condition=Q(same_truth_as=None) | ~Q(same_truth_as=models.F("name")),
                name="split_shares_the_truth_of_another_one",
            ),
        ]

    def __str__(self) -> str:
        return self.name

    def clean(self) -> None:
        """Raise `ValidationError` for rules that make no sense."""
        super().clean()
        if self.announcement and self.announcement_ends_at is None:
            raise ValidationError({"announcement_ends_at": NO_END})
        if self.announcement_ends_at is not None and not self.announcement:
            raise ValidationError({"announcement": NO_TEXT})
        other = self.same_truth_as
        if other is not None and self.is_hidden and self.decimals > other.decimals:
            raise ValidationError(
                {
                    "decimals": f"The split would publish {self.decimals} decimals of the hidden values of "
                    f"{other.pk!r}, which publishes {other.decimals}; expected at most {other.decimals}."
                }
            )

    def faults(self) -> dict[str, str]:
        faults = super().faults()
        if self.opens_at and self.closes_at and self.opens_at >= self.closes_at:
            faults["closes_at"] = (
                f"The split would close at {self.closes_at:%Y-%m-%d %H:%M} UTC and open at "
                f"{self.opens_at:%Y-%m-%d %H:%M} UTC; expected to open before it closes."
            )
        return faults

    def announcement_at(self, now: datetime) -> str:
        ends_at = self.announcement_ends_at
        return self.announcement if ends_at is not None and now < ends_at else ""

    @property
    def is_archived(self) -> bool:
        return self.listing == Listing.ARCHIVED

    @property
    def truth_split_id(self) -> str:
        """Return the split that owns the ground truth: itself, or the one that it shares with."""
        return self.same_truth_as_id or self.pk

    @property
    def has_ground_truth(self) -> bool:
        """Tell whether there is ground truth; `quotas.admissions` says when files are taken."""
        return self.current_edition_id is not None


class GroundTruth(models.Model):
    """A revision of a split's labels, named by its digest. The values are never in the database."""

    digest = models.CharField(max_length=80, primary_key=True)
    manifest_digest = models.CharField(max_length=80, db_index=True)
    split = models.ForeignKey(Split, on_delete=models.PROTECT, related_name="ground_truths")
    source = models.CharField(max_length=200, blank=True, help_text="Name of the file it was read from.")
    n_sequences = models.PositiveIntegerField()
    n_recordings = models.PositiveIntegerField()
    counts = models.JSONField(help_text="Sequences per TTC range, and out of range.")
    imported_at = models.DateTimeField(default=timezone.now)
    imported_by = models.ForeignKey(User, null=True, blank=True, on_delete=models.SET_NULL, related_name="+")

    def __str__(self) -> str:
        return f"{self.split_id} {self.short_digest}"

    @property
    def short_digest(self) -> str:
        return self.digest.removeprefix("sha256:")[:8]

    @staticmethod
    def out_of_range_key(rules: Protocol) -> str:
        """Under what `counts` has the number of sequences in no TTC range of a protocol."""
        return "out_of_range" if rules.ranges == TTC_RANGES else f"out_of_range_of_{rules.name}"


class TruthComparisonQuerySet(models.QuerySet["TruthComparison"]):
    def between(self, one: GroundTruth, other: GroundTruth) -> Self:
        """Return comparisons of these two, in either direction."""
        return self.filter(models.Q(old=one, new=other) | models.Q(old=other, new=one))


class TruthComparison(models.Model):
    """The number of sequences by which two ground truths differ, counted where the values are."""

    old = models.ForeignKey(GroundTruth, on_delete=models.PROTECT, related_name="+")
    new = models.ForeignKey(GroundTruth, on_delete=models.PROTECT, related_name="comparisons")
    n_added = models.PositiveIntegerField()
    n_removed = models.PositiveIntegerField()
    n_changed = models.PositiveIntegerField(help_text="In both, with another time to contact.")
    n_renumbered = models.PositiveIntegerField(
        null=True, help_text="In both, with another anno_id; null where it was not counted in its time."
    )

    objects: ClassVar[TruthComparisonQuerySet] = TruthComparisonQuerySet.as_manager()  # type: ignore[assignment]  # a manager, by its own words

    class Meta:
        constraints = [models.UniqueConstraint(fields=["old", "new"], name="ground_truths_compared_once")]

    def __str__(self) -> str:
        return f"{self.old_id} to {self.new_id}"


class EditionQuerySet(models.QuerySet["Edition"]):
    def in_preparation(self) -> Self:
        """Return editions that may become the board next: drafts, and former ones that were opened again."""
        return self.filter(
            Q(published_at=None, discarded_at=None) | Q(published_at__isnull=False, reopened_at__isnull=False)
        )


class Edition(UnitOfInference):
    """A ground truth, protocol and decimals of a split."""

    split = models.ForeignKey(Split, on_delete=models.PROTECT, related_name="editions")
    number = models.PositiveIntegerField()
    ground_truth = models.ForeignKey(GroundTruth, on_delete=models.PROTECT, related_name="editions")
    protocol = models.CharField(max_length=32)
    decimals = models.PositiveSmallIntegerField(
        default=1,
        help_text="With how many decimals everything of it is published; the split's when it was opened.",
    )
    least_step = models.FloatField(
        null=True,
        default=0.5,
        help_text="The least step between ends of intervals of hidden values; null in earlier editions.",
    )
    opened_at = models.DateTimeField(default=timezone.now)
    opened_by = models.ForeignKey(User, null=True, blank=True, on_delete=models.SET_NULL, related_name="+")
    published_at = models.DateTimeField(null=True, blank=True, help_text="When it first was the board.")
    discarded_at = models.DateTimeField(null=True, blank=True, help_text="Given up before it was published.")
    reopened_at = models.DateTimeField(
        null=True, blank=True, help_text="When a former edition was opened again; null once it is the board."
    )
    # The entries whose intervals and rank ranges stand beside their scores; another set makes them stale.
    inferred_at = models.DateTimeField(null=True, blank=True)
    inference_digest = models.CharField(max_length=80, blank=True)
    floor = models.JSONField(
        null=True,
        blank=True,
        help_text="By score name: what the ground truth itself scores, as published. A worker computes it.",
    )
    n_effective = models.JSONField(
        default=dict,
        blank=True,
        help_text="Effective number of units by score name: the degrees of freedom of its interval.",
    )

    objects: ClassVar[EditionQuerySet] = EditionQuerySet.as_manager()  # type: ignore[assignment]  # a manager, by its own words

    class Meta:
        ordering = ["split", "number"]
        constraints = [
            models.UniqueConstraint(fields=["split", "number"], name="edition_number_once_per_split"),
            models.UniqueConstraint(
                fields=["split", "ground_truth", "protocol", "decimals", "unit"],
                condition=models.Q(discarded_at=None),
                name="one_edition_per_ground_truth_and_protocol",
            ),
            models.CheckConstraint(condition=models.Q(decimals__in=[1, 2]), name="decimals_one_or_two"),
            *UnitOfInference.Meta.constraints,
            models.CheckConstraint(
                condition=models.Q(published_at=None) | models.Q(discarded_at=None),
                name="published_editions_stay",
            ),
            models.CheckConstraint(
                condition=models.Q(reopened_at=None) | models.Q(published_at__isnull=False),
                name="only_former_editions_are_opened_again",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.split_id} edition {self.number}"

    @property
    def rules(self) -> Protocol:
        return get_protocol(self.protocol)

    @property
    def n_out_of_range(self) -> int | None:
        """Sequences in no TTC range of its protocol; None where that protocol came after the count."""
        n: int | None = self.ground_truth.counts.get(GroundTruth.out_of_range_key(self.rules))
        return n

    @property
    def is_draft(self) -> bool:
        return self.published_at is None and self.discarded_at is None

    @property
    def is_in_preparation(self) -> bool:
        """Tell whether it may become the board next, as `EditionQuerySet.in_preparation` finds them."""
        return self.is_draft or self.reopened_at is not None

    def ended_at(self, split: Split) -> datetime | None:
        """Return when an earlier edition last stopped being the board."""
        if self.published_at is None or split.current_edition_id == self.pk:
            return None
        ends = Publication.objects.filter(replaced=self).order_by("-at", "-pk")
        return ends.values_list("at", flat=True).first()


class Publication(models.Model):
    """The public changelog: an edition became the board of its split. Append-only."""

    class Kind(models.TextChoices):
        PUBLISHED = "PUBLISHED", "published"
        ROLLED_BACK = "ROLLED_BACK", "rolled back"

    split = models.ForeignKey(Split, on_delete=models.PROTECT, related_name="publications")
    edition = models.ForeignKey(Edition, on_delete=models.PROTECT, related_name="publications")
    replaced = models.ForeignKey(Edition, null=True, blank=True, on_delete=models.PROTECT, related_name="+")
    kind = models.CharField(max_length=12, choices=Kind)
    at = models.DateTimeField()
    by = models.ForeignKey(User, null=True, blank=True, on_delete=models.SET_NULL, related_name="+")
    reason = models.CharField(max_length=1000)
    left_out = models.JSONField(default=list, blank=True, help_text="Submissions knowingly left unfinished.")

    class Meta:
        ordering = ["-at", "-id"]
        indexes = [models.Index(fields=["split", "at"], name="publication_by_time")]

    def __str__(self) -> str:
        return f"{self.edition} {self.get_kind_display()}"


class PublishedResultQuerySet(models.QuerySet["PublishedResult"]):
    def on_board(self, split: Split, edition: Edition | None, *, at: datetime | None = None) -> Self:
        """Return the rows on a board now, or at a time when `edition` was the board, in order.

        An earlier edition keeps its rows for ever.
        """
        rows = self.filter(split=split).order_by("pk")
        as_of = edition.ended_at(split) if at is None and edition is not None else at
        if as_of is None:
            return rows.filter(replaced_at=None)
        return rows.filter(Q(replaced_at=None) | Q(replaced_at__gt=as_of), added_at__lte=as_of)


class PublishedResult(models.Model):
    """A row quoted from a paper: ranked and marked, never re-scored.

    A corrected row is a new one, so that boards of the past stay.
    """

    split = models.ForeignKey(Split, on_delete=models.PROTECT, related_name="published_results")
    slug = models.SlugField(max_length=64)
    method_name = models.CharField(max_length=80)
    description = models.TextField(blank=True)
    authors = models.CharField(max_length=300)
    source_title = models.CharField(max_length=300)
    source_url = models.URLField()
    source_table = models.CharField(max_length=200)
    code_url = models.URLField(blank=True)
    year = models.PositiveSmallIntegerField()
    uses_nerf = models.BooleanField(default=False)
    latency_ms = models.FloatField(null=True, blank=True)
    hardware = models.CharField(max_length=120, blank=True)
    scores = models.JSONField(help_text="The ten published numbers by name.")
    added_at = models.DateTimeField(
        default=timezone.now, help_text="Since when it stands on the board; 1970: since the split exists."
    )
    replaced_at = models.DateTimeField(
        null=True, blank=True, help_text="Until when it stood there; empty: it still does."
    )

    objects: ClassVar[PublishedResultQuerySet] = PublishedResultQuerySet.as_manager()  # type: ignore[assignment]  # a manager, by its own words

    class Meta:
        constraints = [
            models.UniqueConstraint(
                fields=["split", "slug"],
                condition=Q(replaced_at=None),
                name="published_result_once_per_split",
            ),
            models.CheckConstraint(
                condition=Q(replaced_at=None) | Q(replaced_at__gte=models.F("added_at")),
                name="published_result_is_replaced_after_it_was_added",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.method_name} ({self.split_id}, published)"
