"""What readers are answered from: a board as it was drawn last, and the number that says if it holds."""

from django.db import models
from django.utils import timezone

from leaderboard.models.benchmark import Edition, Split


class BoardVersion(models.Model):
    """Counts what happened to a split's boards. A row of its own, so that nobody who submits waits for it."""

    split = models.OneToOneField(
        Split, primary_key=True, on_delete=models.CASCADE, related_name="board_version"
    )
    number = models.PositiveBigIntegerField(default=0)
    n_times_passed = models.PositiveSmallIntegerField(
        default=0, help_text="Of its split's opening and closing, how many its boards know to be over."
    )

    def __str__(self) -> str:
        return f"{self.split_id} {self.number}"


class Snapshot(models.Model):
    """What everybody sees of an edition, as of one version of its split's boards."""

    edition = models.OneToOneField(Edition, on_delete=models.CASCADE, related_name="snapshot")
    version = models.PositiveBigIntegerField()
    body = models.BinaryField()
    etag = models.CharField(max_length=80)
    made_at = models.DateTimeField(default=timezone.now)

    def __str__(self) -> str:
        return str(self.edition)
