"""What goes wrong again and again: one row for each kind and thing."""

from django.db import models


class Fault(models.Model):
    """A fault that is present while `began_at` is set. `n_ever` is never wiped, so that metrics can count."""

    kind = models.CharField(max_length=32)
    subject = models.CharField(max_length=120, blank=True, help_text="What it hits, such as an edition.")
    began_at = models.DateTimeField(null=True, blank=True)
    last_at = models.DateTimeField(null=True, blank=True)
    n_times = models.PositiveIntegerField(default=0, help_text="How often since it began.")
    n_ever = models.PositiveBigIntegerField(default=0)
    reason = models.CharField(max_length=500, blank=True)

    class Meta:
        constraints = [models.UniqueConstraint(fields=["kind", "subject"], name="one_row_for_each_fault")]

    def __str__(self) -> str:
        return f"{self.kind} {self.subject}".strip()
