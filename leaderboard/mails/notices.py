"""Notices: mails about events to members of one team, each sent once, unless switched off."""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from datetime import datetime, timedelta
from typing import Final

from allauth.account.models import EmailAddress
from django.conf import settings
from django.db.models import Exists, F, OuterRef, QuerySet
from django.urls import reverse

from leaderboard.mails import outbox
from leaderboard.models import (
    ApiToken,
    Evaluation,
    Mail,
    MailKind,
    Publication,
    Split,
    Status,
    Submission,
    SweepBeat,
    User,
)

TOKEN_ENDS_WITHIN: Final = timedelta(days=7)
CLOSES_WITHIN: Final = timedelta(days=3)
# What is committed late is older than the last look; what is older than a day was told, or is no news.
_OVERLAP: Final = timedelta(minutes=10)
_NEWS: Final = timedelta(days=1)
_OUTCOMES: Final = {
    Status.SCORED: ("was scored", "See the result:"),
    Status.REJECTED: ("was rejected", "See the problems in the file:"),
    Status.SYSTEM_ERROR: (
        "could not be scored",
        "This is an error on our side. A maintainer will retry it; you don't need to submit the file again.",
    ),
}


def queue_due(*, now: datetime) -> None:
    """Queue a mail for every event since the last run, and for those that are due soon."""
    last = SweepBeat.objects.values_list("notices_at", flat=True).first()
    # Without a last look there is nothing that anybody waits to be told.
    since = max(last - _OVERLAP, now - _NEWS) if last else now
    outbox.queue([*_scored(since, now), *_editions(since, now), *_tokens(now), *_deadlines(now)])
    SweepBeat.objects.bulk_create(
        [SweepBeat(id=SweepBeat.THE_ONE, notices_at=now)],
        update_conflicts=True,
        unique_fields=["id"],
        update_fields=["notices_at"],
    )


def readers(kind: MailKind) -> QuerySet[User]:
    """Return active users with a proved address who want mails of this kind."""
    people = User.objects.filter(is_active=True)
    if settings.ACCOUNT_EMAIL_VERIFICATION == "mandatory":
        proved = EmailAddress.objects.filter(
            user=OuterRef("pk"), email__iexact=OuterRef("email"), verified=True
        )
        people = people.filter(Exists(proved))
    # No kind is a part of another one's name.
    return people.exclude(muted_kinds__contains=kind).order_by("pk")


def muted_by(user: User) -> set[str]:
    return set(user.muted_kinds.split())


def choose(*, user: User, wanted: Iterable[str]) -> None:
    """Switch on mails of these kinds alone, and those about the account."""
    unwanted = set(MailKind.values) - {MailKind.ACCOUNT.value} - set(wanted)
    user.muted_kinds = " ".join(sorted(unwanted))
    user.save(update_fields=["muted_kinds"])


# --- what there is to tell -------------------------------------------------------------------------------


def _scored(since: datetime, now: datetime) -> Iterator[Mail]:
    # Outcomes of files that people sent on the site; a program asks for its own.
    decided = (
        Evaluation.objects.filter(
            finished_at__gt=since,
            status__in=_OUTCOMES,
            priority=Evaluation.PRIORITY_LIVE,
            edition=F("submission__split__current_edition"),
            submission__withdrawn_at=None,
            submission__via=Submission.Via.WEB,
            submission__submitted_by__in=readers(MailKind.SCORED),
            # Whoever has left the team is told nothing of it any more.
            submission__method__team__members=F("submission__submitted_by"),
        )
        .select_related("submission__method", "submission__split", "submission__submitted_by")
        .order_by("finished_at")
    )
    for evaluation in decided:
        submission = evaluation.submission
        outcome, what_next = _OUTCOMES[Status(evaluation.status)]
        name, split = submission.method.name, submission.split.title
        text = (
            f"Your submission of {name} to {split} {outcome}. {what_next}\n\n"
            f"{_link('submission', submission.pk)}"
        )
        subject = f"{name} on {split} {outcome}"
        key = f"scored:{submission.pk}"
        yield _mail(MailKind.SCORED, submission.submitted_by, key=key, subject=subject, text=text, now=now)


def _editions(since: datetime, now: datetime) -> Iterator[Mail]:
    publications = Publication.objects.filter(at__gt=since, at__lte=now).exclude(replaced=None)
    for publication in publications.select_related("split"):
        scored = Submission.objects.filter(
            withdrawn_at=None, evaluations__edition=publication.replaced, evaluations__status=Status.SCORED
        )
        rows = scored.filter(method__team__members__in=readers(MailKind.EDITION)).values_list(
            "method__team__members", "method__name"
        )
        names: defaultdict[int, set[str]] = defaultdict(set)
        for user_id, name in rows.distinct():
            names[user_id].add(name)
        subject = f"The {publication.split.title} board has a new edition"
        for user in readers(MailKind.EDITION).filter(pk__in=names):
            listed = "\n".join(f"  {name}" for name in sorted(names[user.pk]))
            text = (
                f"{subject}: edition {publication.edition.number}.\nReason: {publication.reason}\n\n"
                f"Your team's methods on it:\n{listed}\n\n"
                f"See what changed:\n\n{_link('editions', publication.split_id)}"
            )
            key = f"edition:{publication.pk}"
            yield _mail(MailKind.EDITION, user, key=key, subject=subject, text=text, now=now)


def _tokens(now: datetime) -> Iterator[Mail]:
    ending = ApiToken.objects.filter(
        revoked_at=None,
        expiry__gt=now,
        expiry__lte=now + TOKEN_ENDS_WITHIN,
        # One that is meant for days ends when it is meant to.
        created__lte=now - TOKEN_ENDS_WITHIN,
        user__in=readers(MailKind.TOKEN),
    )
    for token in ending.select_related("user"):
        text = (
            f"Your API token {token.name} expires on {token.expiry:%Y-%m-%d at %H:%M} UTC. After that, the "
            f"site refuses programs that use it. Create a new token before then:\n\n{_link('tokens')}"
        )
        subject = f"Your API token {token.name} expires on {token.expiry:%Y-%m-%d}"
        key = f"token:{token.digest[:40]}"
        yield _mail(MailKind.TOKEN, token.user, key=key, subject=subject, text=text, now=now)


def _deadlines(now: datetime) -> Iterator[Mail]:
    for split in Split.objects.filter(closes_at__gt=now, closes_at__lte=now + CLOSES_WITHIN):
        at = f"{split.closes_at:%Y-%m-%d at %H:%M} UTC"
        subject = f"Submissions to {split.title} close on {at}"
        text = f"{subject}. Send your last files before then:\n\n{_link('submit')}?split={split.pk}"
        for user in readers(MailKind.DEADLINE).filter(has_sent_to(split)):
            key = f"deadline:{split.pk}:{split.closes_at:%Y%m%d%H%M}"
            yield _mail(MailKind.DEADLINE, user, key=key, subject=subject, text=text, now=now)


def has_sent_to(split: Split) -> Exists:
    """Make a condition on users: their team has an active submission to the split."""
    sent = Submission.objects.filter(split=split, withdrawn_at=None, method__team__members=OuterRef("pk"))
    return Exists(sent)


def framed(*, subject: str, text: str) -> tuple[str, str]:
    """Frame subject and text with the site's name and the link to switch notices off."""
    name = settings.BENCHMARK.site_name
    footer = f"--\n{name}\n{settings.SITE_URL}\nChoose which emails you get: {_link('mails')}"
    return f"[{name}] {subject}", f"{text}\n\n{footer}\n"


def _mail(kind: MailKind, user: User, *, key: str, subject: str, text: str, now: datetime) -> Mail:
    subject, text = framed(subject=subject, text=text)
    return outbox.notice(kind=kind, user=user, key=f"{key}:{user.pk}", subject=subject, text=text, now=now)


def _link(name: str, *arguments: object) -> str:
    return f"{settings.SITE_URL}{reverse(name, args=arguments)}"
