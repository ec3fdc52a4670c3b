"""The time of the last sweep, by the database's clock."""

from django.db import models
from django.db.models import Q


class SweepBeat(models.Model):
    THE_ONE = 1

    id = models.PositiveSmallIntegerField(primary_key=True, default=THE_ONE, editable=False)
    swept_at = models.DateTimeField(null=True, blank=True)
    n_out_of_reach = models.PositiveIntegerField(
        default=0, help_text="What waited for a ground truth that the sweeping worker cannot read."
    )

    # When a worker last began to sweep, to clean, and to send mails; see `upkeep.pollers`.
    sweep_begun_at = models.DateTimeField(null=True, blank=True)
    clean_begun_at = models.DateTimeField(null=True, blank=True)
    mails_begun_at = models.DateTimeField(null=True, blank=True)
    # Until when everything that people are told by mail is queued; see `mails.notices`.
    notices_at = models.DateTimeField(null=True, blank=True)

    # What was removed because no submission named it, since the beginning; see `upkeep.pollers`.
    cleaned_at = models.DateTimeField(null=True, blank=True)

    # The file store, as a worker last found it; see `upkeep.store_check`.
    store_begun_at = models.DateTimeField(null=True, blank=True)
    store_checked_at = models.DateTimeField(null=True, blank=True)
    store_free_bytes = models.PositiveBigIntegerField(
        null=True, blank=True, help_text="Room for further files; empty if unknown."
    )

    class Meta:
        constraints = [models.CheckConstraint(condition=Q(id=1), name="one_sweep_beat")]

    def __str__(self) -> str:
        return f"last sweep {self.swept_at:%Y-%m-%d %H:%M:%S}" if self.swept_at else "no sweep yet"
