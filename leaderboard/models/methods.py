"""Methods: their details and their visibility."""

import uuid
from datetime import datetime
from typing import ClassVar, Self

from django.contrib.auth.models import AnonymousUser
from django.core.validators import MaxValueValidator, MinValueValidator
from django.db import models
from django.db.models import Q
from django.utils import timezone

from leaderboard.models import days
from leaderboard.models.people import Membership, Team, User

# Larger than any error or latency; what lies beyond is NaN or an infinity, which PostgreSQL sorts above it.
FINITE = 1e300


class Visibility(models.TextChoices):
    PRIVATE = "PRIVATE", "private"
    ANONYMOUS = "ANONYMOUS", "anonymous"
    PUBLIC = "PUBLIC", "public"


class Cameras(models.TextChoices):
    ONE = "ONE", "one camera"
    SEVERAL = "SEVERAL", "several cameras"


class BoxSource(models.TextChoices):
    GIVEN = "GIVEN", "provided"
    DETECTED = "DETECTED", "own detector"
    NONE = "NONE", "none"


class MethodQuerySet(models.QuerySet["Method"]):
    def existing(self) -> Self:
        """Return methods that their team has not deleted."""
        return self.filter(deleted_at=None)

    def shown(self, *, at: datetime | None = None) -> Self:
        """Return methods that everybody sees, under their name or a pseudonym, now or as of `at`."""
        rows = self.exclude(visibility=Visibility.PRIVATE)
        if at is None:
            return rows
        by_then = Q(visibility=Visibility.ANONYMOUS, shown_at__lte=days.known_until(at, is_masked=True))
        return rows.filter(by_then | Q(shown_at__lte=at))

    def of(self, user: User | AnonymousUser) -> Self:
        if not user.is_authenticated:
            return self.none()
        return self.existing().filter(team__in=Membership.objects.filter(user=user).values("team"))

    def visible_to(self, user: User | AnonymousUser) -> Self:
        """Return what everybody sees, and the person's own team's; maintainers see all.

        Whether it may be named is `Method.is_named_for`.
        """
        if not user.is_authenticated:
            return self.shown()
        if user.acts_as_maintainer:
            return self
        own = Membership.objects.filter(user=user).values("team")
        return self.existing().filter(~Q(visibility=Visibility.PRIVATE) | Q(team__in=own))


class Method(models.Model):
    id = models.UUIDField(primary_key=True, default=uuid.uuid4, editable=False)
    team = models.ForeignKey(Team, on_delete=models.PROTECT, related_name="methods")
    name = models.CharField(max_length=80)
    # What the name of a public method looks like: no two of them have one look. None while it is not public.
    look = models.CharField(  # noqa: DJ001 - unique, and an empty text is one
        max_length=360, null=True, unique=True, editable=False
    )
    description = models.TextField(blank=True, max_length=2000)
    paper_url = models.URLField(blank=True, max_length=500)
    code_url = models.URLField(blank=True, max_length=500)
    # What it uses and costs, as its team says; empty where nothing was said.
    n_frames = models.PositiveSmallIntegerField(
        "frames used", null=True, blank=True, validators=[MinValueValidator(2), MaxValueValidator(6)]
    )
    cameras = models.CharField(max_length=12, choices=Cameras, blank=True)
    box_source = models.CharField(max_length=12, choices=BoxSource, blank=True)
    uses_nerf = models.BooleanField("NeRF data", null=True, blank=True)
    uses_extra_data = models.BooleanField("extra data", null=True, blank=True)
    pretraining = models.CharField(max_length=200, blank=True)
    n_parameters = models.PositiveBigIntegerField("parameters", null=True, blank=True)
    latency_ms = models.FloatField("latency in ms", null=True, blank=True)
    hardware = models.CharField(max_length=120, blank=True)
    visibility = models.CharField(max_length=12, choices=Visibility, default=Visibility.PRIVATE)
    shown_at = models.DateTimeField(null=True, blank=True, help_text="When it first left private.")
    reveal_at = models.DateTimeField(null=True, blank=True, help_text="When an anonymous one turns public.")
    created_at = models.DateTimeField(default=timezone.now)
    renamed_at = models.DateTimeField(null=True, blank=True)
    deleted_at = models.DateTimeField(
        null=True,
        blank=True,
        help_text="When its team deleted it, which never had a score; its rejected files stay.",
    )

    objects: ClassVar[MethodQuerySet] = MethodQuerySet.as_manager()  # type: ignore[assignment]  # a manager, by its own words

    class Meta:
        constraints = [
            models.UniqueConstraint(
                fields=["team", "name"], condition=Q(deleted_at=None), name="method_name_once_per_team"
            ),
            models.CheckConstraint(
                condition=Q(deleted_at=None) | Q(visibility=Visibility.PRIVATE),
                name="what_was_shown_is_not_deleted",
            ),
            models.CheckConstraint(
                condition=Q(n_frames=None) | Q(n_frames__gte=2, n_frames__lte=6),
                name="method_uses_2_to_6_frames",
            ),
            models.CheckConstraint(
                condition=Q(latency_ms=None) | Q(latency_ms__gt=0, latency_ms__lt=FINITE),
                name="method_latency_is_finite",
            ),
            models.CheckConstraint(
                condition=Q(visibility=Visibility.PRIVATE) | Q(shown_at__isnull=False),
                name="what_is_shown_has_been_shown_since",
            ),
        ]

    def __str__(self) -> str:
        return self.name

    @property
    def pseudonym(self) -> str:
        """Return the constant name of an anonymous method, from its random id alone."""
        return f"Anonymous {self.id.hex[:6]}"

    def was_shown(self, *, at: datetime | None = None) -> bool:
        """Tell whether everybody sees it, now or as of `at`."""
        if self.visibility == Visibility.PRIVATE:
            return False
        return at is None or (self.shown_at is not None and self.shown_at <= self.known_until(at))

    def was_shown_before(self, at: datetime) -> bool:
        """Tell whether everybody saw it at that very moment."""
        return self.was_shown() and self.shown_at is not None and self.shown_at <= at

    @property
    def is_masked(self) -> bool:
        return self.visibility == Visibility.ANONYMOUS

    def known_until(self, at: datetime) -> datetime:
        return days.known_until(at, is_masked=self.is_masked)

    def is_named_for(self, user: User | AnonymousUser) -> bool:
        """Tell whether a reader may know the team: it is public, theirs, or they are a maintainer."""
        if self.visibility == Visibility.PUBLIC:
            return True
        if not user.is_authenticated:
            return False
        return user.acts_as_maintainer or self.team.memberships.filter(user=user).exists()
