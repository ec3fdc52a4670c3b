"""The texts that maintainers write: pages such as rules or privacy, and the announcement of the site."""

from typing import Any, Final

from django.db import models
from django.utils import timezone

from leaderboard.models.people import User

ANNOUNCEMENT: Final = "announcement"


class PageVersion(models.Model):
    """A text that a page has, or had. Rows are only added; the highest number is shown.

    Written by `leaderboard.pages.texts`. One row is no page but the line that all pages about splits show
    until it ends; `leaderboard.editions.policy` writes and deletes it.
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
        """The announcement of the site: one row or none."""
        return cls.objects.filter(page=ANNOUNCEMENT, number=1)

    @classmethod
    def announcement_of_every_row(cls) -> dict[str, "models.Subquery[Any]"]:
        """Annotations with its text and its end, for a query that is made anyway."""
        return {
            "site_line": models.Subquery(cls.announcement().values("text")[:1]),
            "site_line_ends_at": models.Subquery(cls.announcement().values("ends_at")[:1]),
        }
