"""What a site shows for seconds or never, made to stand still so that it can be looked at.

Both functions run in a process of the site (`manage.py shell`), because the site's database is its own; its
worker stands still meanwhile.
"""

import json
from datetime import timedelta
from typing import Any, Final

from django.conf import settings
from django.template.loader import render_to_string
from django.utils import timezone

import evaluator
from leaderboard.errors import outages
from leaderboard.models import Edition, Evaluation, Status, Submission, User
from leaderboard.ops import rate_limits
from leaderboard.people import invitations, teams
from leaderboard.storage import truth_values
from leaderboard.submissions import intake
from tests import builders
from tests.leaderboard.web.maintain import queue_rows

LONG: Final = timedelta(hours=1)
MANY_FAULTS: Final = b'{"0": NaN, "1": 0, "2": "near", "3": null, "4": 1e999, "x": 3, "0": 5}'


def make(split: str, email: str) -> str:
    """Make one submission in each state; the addresses of what there is to see by name, as JSON."""
    user = User.objects.get(email=email)
    shown = {f"submission-{name}": f"/submissions/{each.pk}/" for name, each in _sent(user, split).items()}
    empty = Submission.objects.get(method__name="Many problems").method_id
    invitation, secret = invitations.make(team=teams.team_of(user=user), actor=user, now=timezone.now())
    invitations.revoke(invitation=invitation, actor=user, now=timezone.now())
    return json.dumps(
        shown
        | {
            "method-empty": f"/methods/{empty}/",
            "method-empty-delete": f"/methods/{empty}/delete/",
            "invitation-over": f"/team/join/{secret}/",
            "board-wrong-filter": f"/board/{split}/?latency=50+ms&parameters=abc&frames=6",
        }
    )


def _sent(user: User, split: str) -> dict[str, Submission]:
    truth = truth_values.load(Edition.objects.get(split=split).ground_truth_id)

    def send(method: str, *, factor: float = 1.2, data: bytes = b"") -> Submission:
        file = data or evaluator.write_predictions(manifest=truth.manifest, ttc_s=truth.ttc_s * factor)
        return builders.send(user, file, split=split, method=method).submission

    made = {
        "withdrawn": send("Given up"),
        "warned": send("In milliseconds", factor=1000.0),
        "rejected-for-many-reasons": send("Many problems", data=MANY_FAULTS),
    }
    builders.score_all()
    made["failed"] = send("Stops its reader")
    queue_rows.strike_out()
    for name in ("running-late", "running"):
        made[name] = send(name.capitalize())
        queue_rows.claim()
    made |= {name: send(name.capitalize()) for name in ("queued-late", "cancelled", "queued")}
    for name in ("withdrawn", "cancelled"):
        intake.withdraw(submission=made[name], actor=user, now=timezone.now())
    for name in ("running", "queued"):
        _move(made[name], LONG)  # so it does not become late while it is looked at
        _move(made[f"{name}-late"], -LONG)
    return made


def _move(submission: Submission, shift: timedelta) -> None:
    row = Evaluation.objects.get(submission=submission)
    row.queued_at += shift
    if row.status == Status.RUNNING and row.started_at:
        row.started_at += shift
    row.save(update_fields=["queued_at", "started_at"])


def failures() -> str:
    """The pages for what goes wrong before or outside of any view, by name, as JSON."""
    too_many = {"sentence": rate_limits.refusal(125.0), "back": "/submit/"}
    too_large = {"sentence": intake.too_large(n_bytes=34_000_000)}
    # Only people who are signed in are refused a page, or send a file.
    signed_in = {"user": User.objects.filter(is_active=True).first()}
    pages: dict[str, tuple[str, dict[str, Any]]] = {
        "failure-400": ("400.html", {}),
        "failure-403": ("403.html", signed_in),
        "failure-403-form": ("403_csrf.html", {"cause": "form"}),
        "failure-413": ("413.html", too_large | signed_in),
        "failure-429": ("429.html", too_many),
        "failure-500": ("500.html", {}),
        "failure-503": ("outage.html", {"outage": outages.DATABASE_AWAY}),
    }
    common = {"benchmark": settings.BENCHMARK}
    return json.dumps({name: render_to_string(path, common | more) for name, (path, more) in pages.items()})
