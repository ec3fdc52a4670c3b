"""The pages that maintainers write: rules, contact, privacy, imprint, licence."""

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
