"""Mails to be sent."""

from django.db import models
from django.db.models import Q
from django.utils import timezone

from leaderboard.models.people import User


class MailKind(models.TextChoices):
    """What a mail is about. A person can switch off every kind but the first."""

    ACCOUNT = "account", "Your account"
    SCORED = "scored", "A file that I submitted on the site is scored, is rejected, or cannot be scored"
    EDITION = "edition", "A board that lists my team’s methods gets a new edition"
    TOKEN = "token", "One of my API tokens expires within a week"
    DEADLINE = "deadline", "A split that my team submitted to closes within three days"
    ANNOUNCEMENT = "announcement", "There is an announcement about a split that my team submitted to"


class Mail(models.Model):
    """A mail to one person. Once it is sent, its text and recipient are cleared.

    One that was never sent keeps its recipient, and the reason, for `outbox.KEPT`.
    """

    kind = models.CharField(max_length=16, choices=MailKind)
    user = models.ForeignKey(User, null=True, blank=True, on_delete=models.CASCADE, related_name="+")
    recipient = models.EmailField(blank=True)
    subject = models.CharField(max_length=250, blank=True)
    text = models.TextField(blank=True)
    key = models.CharField(  # noqa: DJ001 - mails about an account have none, and there may be many
        max_length=120,
        null=True,
        unique=True,
        help_text="What it tells whom, so that it is told once.",
    )
    queued_at = models.DateTimeField(default=timezone.now)
    due_at = models.DateTimeField(default=timezone.now)
    n_tries = models.PositiveSmallIntegerField(default=0)
    ended_at = models.DateTimeField(null=True, blank=True, help_text="When it was sent or given up.")
    is_sent = models.BooleanField(default=False)
    reason = models.CharField(
        max_length=200, blank=True, help_text="What the mail server said when it did not take this mail."
    )

    class Meta:
        indexes = [models.Index(fields=["due_at"], condition=Q(ended_at=None), name="mails_that_wait")]

    def __str__(self) -> str:
        return f"{self.kind} mail of {self.queued_at:%Y-%m-%d}"
