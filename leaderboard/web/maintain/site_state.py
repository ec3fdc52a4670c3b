"""The state of the site for its operator: what `/healthy` names, with numbers and reasons."""

from collections.abc import Iterator
from datetime import datetime
from typing import NamedTuple

from django.conf import settings

from evaluator.counting import counted
from leaderboard.mails import outbox
from leaderboard.models import AuditEvent, Fault, Installation, Mail, SweepBeat
from leaderboard.ops import backup_runs, faults, health
from leaderboard.web.formatting import duration

_GB = 1e9


class Line(NamedTuple):
    """One thing, in what state it is, and the reasons of faults."""

    name: str
    text: str
    is_bad: bool = False
    reasons: tuple[str, ...] = ()


def lines(*, now: datetime) -> list[Line]:
    """Return the state of each thing."""
    return [
        _workers(),
        _broker(),
        _ground_truth(),
        _store(now=now),
        _unused_files(now=now),
        _uploads(now=now),
        _statistics(now=now),
        _backups(now=now),
        _mails(now=now),
        _audit_log(),
    ]


def _ago(moment: datetime, *, now: datetime) -> str:
    return f"{duration((now - moment).total_seconds())} ago"


def _workers() -> Line:
    age_s = health.sweep_age_s()
    if age_s is None:
        return Line("Workers", "no worker ran yet: nothing is scored", is_bad=True)
    return Line("Workers", f"last seen {duration(age_s)} ago", is_bad=age_s > health.MAX_SWEEP_AGE_S)


def _broker() -> Line:
    if health.broker().is_ok:
        return Line("Broker", "answers")
    return Line("Broker", "does not answer: files are scored some seconds later", is_bad=True)


def _ground_truth() -> Line:
    n_waiting = health.n_out_of_reach()
    if not n_waiting:
        return Line("Ground truth", "workers can read it for all files that wait")
    waiting = counted(n_waiting, "file waits", "files wait")
    return Line("Ground truth", f"no worker can read it: {waiting}", is_bad=True)


def _store(*, now: datetime) -> Line:
    fault = faults.present([faults.STORE], now=now).first()
    if fault is not None:
        what = f"files cannot be stored by the workers of {fault.subject}"
        return Line("File store", _lasting(what, fault, now=now), True, (fault.reason,))
    beat = SweepBeat.objects.exclude(store_checked_at=None).first()
    if beat is None or beat.store_checked_at is None:
        return Line("File store", "not checked yet")
    checked = f"files can be stored (checked {_ago(beat.store_checked_at, now=now)})"
    if beat.store_free_bytes is None:
        return Line("File store", checked)
    room = f"room for {beat.store_free_bytes / _GB:,.1f} GB"
    return Line("File store", f"{checked}, {room}", is_bad=not health.has_room(beat.store_free_bytes))


def _unused_files(*, now: datetime) -> Line:
    owner = Installation.objects.values_list("store_is_of", flat=True).first()
    if owner:
        text = (
            f"stay, since the file store belongs to another site ({owner}); claim_store makes it this site’s"
        )
        return Line("Unused files", text, is_bad=True)
    beat = SweepBeat.objects.first()
    cleaned_at = beat.cleaned_at if beat else None
    text = f"last looked for {_ago(cleaned_at, now=now)}" if cleaned_at else "not looked for yet"
    return Line("Unused files", text, is_bad=not health.is_cleaned(now=now))


def _uploads(*, now: datetime) -> Line:
    fault = faults.present([faults.UPLOADS], now=now).first()
    if fault is None or fault.last_at is None:
        return Line("Uploads", "none was refused because of an error of the site")
    text = f"{counted(fault.n_times, 'upload')} refused because of an error of the site, the last "
    return Line(
        "Uploads", f"{text}{_ago(fault.last_at, now=now)}; none accepted since", True, (fault.reason,)
    )


def _statistics(*, now: datetime) -> Line:
    present = list(faults.present(faults.STATISTICS, now=now, min_times=faults.MIN_TIMES))
    if not present:
        return Line("Statistics", "no fault")
    reasons = tuple(
        f"{_lasting(f'{fault.kind} of {fault.subject} fail', fault, now=now)}: {fault.reason}"
        for fault in present
    )
    return Line("Statistics", "some fail again and again", True, reasons)


def _lasting(what: str, fault: Fault, *, now: datetime) -> str:
    began_at = fault.began_at or now
    return f"{what}, {counted(fault.n_times, 'time')} in {duration((now - began_at).total_seconds())}"


def _backups(*, now: datetime) -> Line:
    good = backup_runs.last_good()
    text = "there is no good one"
    if good is not None and good.finished_at is not None:
        text = (
            f"the last good one ended {_ago(good.finished_at, now=now)}, with {counted(good.n_files, 'file')}"
        )
        if good.n_lost:
            text += f", without {counted(good.n_lost, 'file')} known to be lost"
    failed = backup_runs.failed_since_good(now=now)
    n_failed = failed.count()
    if good is None and not n_failed:
        return Line("Backups", "none was made yet")
    if not n_failed:
        return Line("Backups", text, is_bad=backup_runs.is_overdue(now=now))
    last = failed[0]
    text += f"; {counted(n_failed, 'later backup' if good else 'backup')} failed"
    reason = last.fault or "The process ended before the backup was complete."
    return Line("Backups", text, True, (f"{_ago(last.started_at, now=now)}: {reason}",))


def _mails(*, now: datetime) -> Line:
    if not settings.SENDS_MAIL:
        return Line("Emails", "no mail server is set")
    text = "".join(_mail_parts(now=now))
    fault = faults.present([faults.MAIL], now=now).first()
    if fault is None or not outbox.waiting():
        return Line("Emails", text, health.mails_wait(now=now) or health.mails_are_refused(now=now))
    reason = f"{_lasting('the mail server takes none', fault, now=now)}: {fault.reason}"
    return Line("Emails", text, True, (reason,))


def _mail_parts(*, now: datetime) -> Iterator[str]:
    yield f"{outbox.waiting():,} waiting"
    oldest = Mail.objects.filter(ended_at=None, reason="").order_by("queued_at").first()
    if oldest is not None:
        yield f", the oldest for {duration((now - oldest.queued_at).total_seconds())}"
    if health.mails_are_refused(now=now):
        yield "; the mail server refused most of the last day"


def _audit_log() -> Line:
    unsealed = AuditEvent.objects.unsealed()
    if not unsealed.n_events:
        return Line("Audit log", "sealed")
    age = duration(unsealed.oldest_age_s)
    text = f"{counted(unsealed.n_events, 'event')} not sealed yet, the oldest for {age}"
    return Line("Audit log", text, is_bad=unsealed.oldest_age_s >= health.MAX_UNSEALED_AGE_S)
