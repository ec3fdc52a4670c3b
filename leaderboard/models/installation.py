"""What a database says of itself: which site it is, and whether it came from a backup."""

import uuid

from django.db import models
from django.db.models import Q


class Installation(models.Model):
    """One row; see `leaderboard.storage.ownership`."""

    THE_ONE = 1

    id = models.PositiveSmallIntegerField(primary_key=True, default=THE_ONE, editable=False)
    site_id = models.UUIDField(
        default=uuid.uuid4, help_text="Another one after each restore; the file store has it, too."
    )
    restored_at = models.DateTimeField(
        null=True, blank=True, help_text="When this database was restored from a backup."
    )
    store_is_of = models.CharField(
        max_length=80,
        blank=True,
        help_text="Whose the file store is, if not this site’s; empty: this site’s.",
    )

    class Meta:
        constraints = [models.CheckConstraint(condition=Q(id=1), name="one_installation")]

    def __str__(self) -> str:
        return f"site {self.site_id}"
