"""The texts that maintainers write: pages such as rules or privacy, and the announcement of the site."""

from datetime import datetime
from typing import Any

from django.db import models
from django.utils import timezone

from leaderboard.models.people import User


class PageVersion(models.Model):
    """A text that a page has, or had. Rows are only added; the highest number is shown.

    Written by `leaderboard.pages.pages`.
    """

    page = models.CharField(max_length=20)
    number = models.PositiveIntegerField()
    text = models.TextField(help_text="Markdown.")
    written_at = models.DateTimeField(default=timezone.now)
    written_by = models.ForeignKey(User, null=True, blank=True, on_delete=models.SET_NULL, related_name="+")

    class Meta:
        ordering = ["page", "-number"]
        constraints = [
            models.UniqueConstraint(fields=["page", "number"], name="versions_of_a_page_have_numbers"),
        ]

    def __str__(self) -> str:
        return f"{self.page}, version {self.number}"


class SiteAnnouncement(models.Model):
    """The line that all pages about splits show until it ends. Written by `leaderboard.benchmark.policy`."""

    id = models.PositiveSmallIntegerField(primary_key=True, default=1, editable=False)
    text = models.CharField(max_length=300)
    ends_at = models.DateTimeField()

    class Meta:
        constraints = [
            models.CheckConstraint(condition=models.Q(id=1), name="one_announcement_of_the_site"),
        ]

    def __str__(self) -> str:
        return self.text

    @classmethod
    def line_at(cls, now: datetime) -> str:
        """The line that pages show at this moment; empty where there is none, or where it has ended."""
        return cls.objects.filter(ends_at__gt=now).values_list("text", flat=True).first() or ""

    @classmethod
    def of_every_row(cls) -> dict[str, "models.Subquery[Any]"]:
        """Annotations with its text and its end, for a query that is made anyway."""
        return {
            "site_line": models.Subquery(cls.objects.values("text")[:1]),
            "site_line_ends_at": models.Subquery(cls.objects.values("ends_at")[:1]),
        }
