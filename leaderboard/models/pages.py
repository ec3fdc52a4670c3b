"""Texts of maintainers: pages, and the announcement of the site."""

from typing import Any, Final

from django.db import models
from django.utils import timezone

from leaderboard.models.people import User

ANNOUNCEMENT: Final = "announcement"


class PageVersion(models.Model):
    """A version of a page's text; the highest number is shown. Rows are only added.

    One row is the site's announcement; `leaderboard.editions.policy` writes and deletes it.
    """

    page = models.CharField(max_length=20)
    number = models.PositiveIntegerField()
    text = models.TextField(help_text="Markdown; of an announcement plain text.")
    ends_at = models.DateTimeField(null=True, help_text="Of an announcement.")
    written_at = models.DateTimeField(default=timezone.now)
    written_by = models.ForeignKey(User, null=True, blank=True, on_delete=models.SET_NULL, related_name="+")

    class Meta:
        ordering = ["page", "-number"]
        constraints = [
            models.UniqueConstraint(fields=["page", "number"], name="versions_of_a_page_have_numbers"),
        ]

    def __str__(self) -> str:
        return f"{self.page}, version {self.number}"

    @classmethod
    def announcement(cls) -> "models.QuerySet[PageVersion]":
        return cls.objects.filter(page=ANNOUNCEMENT, number=1)

    @classmethod
    def announcement_of_every_row(cls) -> dict[str, "models.Subquery[Any]"]:
        """Annotate a query with the announcement's text and end, to save a second query."""
        return {
            "site_line": models.Subquery(cls.announcement().values("text")[:1]),
            "site_line_ends_at": models.Subquery(cls.announcement().values("ends_at")[:1]),
        }
