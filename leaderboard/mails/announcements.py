"""Announcements: mails of maintainers to the people whose teams sent a file to a split."""

import hashlib
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from django.db import transaction
from django.db.models import QuerySet

from leaderboard import audit
from leaderboard.errors.refusals import Refused, clean_text, require_maintainer
from leaderboard.mails import notices, outbox
from leaderboard.models import Mail, MailKind, Split, User

MAX_SUBJECT: Final = 150
MAX_TEXT: Final = 5000


@dataclass(frozen=True)
class Announcement:
    split: Split
    subject: str
    text: str

    @property
    def mailed(self) -> tuple[str, str]:
        """Return subject and text of the mail."""
        return notices.framed(subject=self.subject, text=self.text)

    def key(self, user_id: int) -> str:
        # A person gets each announcement once.
        digest = hashlib.sha256(f"{self.subject}\n{self.text}".encode()).hexdigest()
        return f"announcement:{self.split.pk}:{digest[:16]}:{user_id}"


def cleaned(*, split: Split, subject: str, text: str) -> Announcement:
    """Check an announcement. Raises `Refused` for what is empty or too long."""
    subject = " ".join(clean_text("subject", subject, limit=MAX_SUBJECT).split())
    text = clean_text("text", text.replace("\r\n", "\n"), limit=MAX_TEXT)
    return Announcement(split, subject, text)


def readers(split: Split) -> QuerySet[User]:
    """Return users who want announcements and whose team sent a file to the split."""
    return notices.readers(MailKind.ANNOUNCEMENT).filter(notices.has_sent_to(split))


def recipients(announcement: Announcement) -> list[User]:
    """Return the readers of its split who have not got this one."""
    keys = {user: announcement.key(user.pk) for user in readers(announcement.split)}
    sent_keys = set(Mail.objects.filter(key__in=keys.values()).values_list("key", flat=True))
    return [user for user, key in keys.items() if key not in sent_keys]


def announce(announcement: Announcement, *, now: datetime, actor: User | None) -> int:
    """Queue an announcement for all who have not got it. Returns how many. Raises `NotMaintainer`."""
    require_maintainer(actor, to="mail the teams of a split")
    with transaction.atomic():
        split = Split.objects.select_for_update(no_key=True).filter(pk=announcement.split.pk).first()
        if split is None:
            raise Refused("unknown-split", f"There is no split {announcement.split.pk!r} any more.")
        people = recipients(announcement)
        subject, text = announcement.mailed
        outbox.queue(
            [
                outbox.notice(
                    kind=MailKind.ANNOUNCEMENT,
                    user=user,
                    key=announcement.key(user.pk),
                    subject=subject,
                    text=text,
                    now=now,
                )
                for user in people
            ]
        )
        if people:
            audit.record_of(
                split,
                "announced",
                actor=actor,
                details={"subject": announcement.subject, "n_people": len(people)},
            )
    return len(people)
