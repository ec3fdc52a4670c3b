"""The version of a split's boards."""

from django.db import models

from leaderboard.models.benchmark import Split


class BoardVersion(models.Model):
    """Counts changes of a split's boards; a row of its own, so that submitting does not wait for its lock."""

    split = models.OneToOneField(
        Split, primary_key=True, on_delete=models.CASCADE, related_name="board_version"
    )
    number = models.PositiveBigIntegerField(default=0)
    n_times_passed = models.PositiveSmallIntegerField(
        default=0, help_text="Of its split's opening and closing, how many its boards know to be over."
    )

    def __str__(self) -> str:
        return f"{self.split_id} {self.number}"
