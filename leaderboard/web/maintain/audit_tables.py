"""The rows of the audit log with names and links in place of ids."""

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final, NamedTuple

from django.core.exceptions import ValidationError
from django.db.models import Model
from django.urls import reverse
from django.utils.dateparse import parse_duration

from leaderboard import audit
from leaderboard.methods.details import DETAILS
from leaderboard.models import (
    AuditEvent,
    Edition,
    Evaluation,
    Method,
    Split,
    Submission,
    Team,
    User,
    Visibility,
)
from leaderboard.models.benchmark import Listing
from leaderboard.pages.texts import PAGES
from leaderboard.quotas.spans import span
from leaderboard.submissions.status_text import short_fault
from leaderboard.web.maintain.quota_forms import QuotaRulesForm

MAX_LISTED: Final = 5
_DIGEST: Final = re.compile(r"(sha256:[0-9a-f]{8})[0-9a-f]{56}")
_MOMENT: Final = re.compile(r"(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d):\d\d(?:\.\d+)?\+00:00")
# In `before → after`, as a change of a split is kept.
_PYTHON: Final = re.compile(r"(?<=→ )(?:None|True|False)$|^(?:None|True|False)(?= →)")
_WORDS: Final = {"None": "none", "True": "yes", "False": "no"}
_SPAN: Final = re.compile(r"(?:(?<=→ )|^)(?:\d+ days?, )?\d+:\d\d:\d\d(?= →|$)")
_FIELDS: Final = (
    {each.name: each.label.lower() for each in DETAILS}
    | {name: str(field.label).lower() for name, field in QuotaRulesForm.base_fields.items()}
    | {"paper_url": "paper link", "code_url": "code link"}
)
# Details that name a row by its id.
_KEYS: Final = {"user": "User", "team": "Team", "from": "Team", "to": "Team", "split": "Split"}
_CHOICES: Final = {*Visibility.values, *Listing.values}
# Every verb that the code writes, as maintainers read it beside its object.
_VERBS: Final = {
    "acknowledged": "acknowledged as lost",
    "added": "added",
    "admission_ended": "admission ended",
    "admitted": "admitted",
    "announced": "announced",
    "appointed_owner": "owner appointed",
    "cancelled": "cancelled",
    "changed": "changed",
    "claimed": "claimed for this site",
    "cleared": "texts deleted",
    "closed": "closed",
    "closed_again": "closed again",
    "created": "created",
    "deleted": "deleted",
    "discarded": "discarded",
    "edited": "edited",
    "forgotten": "forgotten",
    "given back": "given back to its owner",
    "handed_over": "ownership handed over",
    "hidden": "removed from all boards",
    "imported": "imported",
    "invited": "member invited",
    "joined": "joined",
    "left": "left",
    "moved": "moved",
    "opened": "opened",
    "published": "published",
    "quota_overridden": "quota overridden",
    "quota_restored": "quota restored",
    "recovered": "recovered by its owner",
    "rejected": "rejected",
    "removed": "removed",
    "removed_member": "member removed",
    "renamed": "renamed",
    "reopened": "opened again",
    "retried": "retried",
    "revealed": "made public on its day",
    "revoked": "revoked",
    "revoked_invitation": "invitation revoked",
    "rolled_back": "rolled back",
    "scored": "scored",
    "second factor reset": "two-factor authentication switched off",
    "shown": "visibility changed",
    "submitted": "submitted",
    "system_error": "system error",
    "withdrawn": "withdrawn",
}
_NOUNS: Final = {
    "ApiToken": "API token",
    "FileStore": "File store",
    "GroundTruth": "Ground truth",
    "LostFile": "Lost file",
    "PublishedResult": "Published result",
    "SiteAnnouncement": "Announcement of the site",
    "User": "Person",
}


def verb_words(verb: str) -> str:
    """Word an action.

    >>> verb_words("shown"), verb_words("quota_overridden")
    ('visibility changed', 'quota overridden')
    """
    return _VERBS.get(verb, verb.replace("_", " "))


def noun_words(noun: str) -> str:
    return _NOUNS.get(noun, noun)


class Subject(NamedTuple):
    """What an event is about: its name, its page if it has one, what tells it from others, why it failed."""

    name: str
    href: str = ""
    about: str = ""
    reason: str = ""


class AuditRow(NamedTuple):
    event: AuditEvent
    verb: str
    noun: str
    subject: Subject
    details: list[tuple[str, str]]

    @property
    def detail_words(self) -> str:
        """The details in one line, such as "name: A → B; reason: a name of a person"."""
        return "; ".join(f"{name}: {value}" if name else value for name, value in self.details)


def audit_rows(events: Iterable[AuditEvent]) -> list[AuditRow]:
    events = list(events)
    names = audit.names_in(events)
    subjects = _subjects(events)
    return [
        AuditRow(
            event,
            verb_words(event.verb),
            noun_words(event.noun),
            subjects.get((event.noun, event.noun_id), Subject(_words(event.noun_id))),
            _details(event, names, subjects),
        )
        for event in events
    ]


def named(event: AuditEvent, names: Mapping[str, str]) -> dict[str, str]:
    """Return the details that stand for a name, as that name."""
    texts = {name: value for name, value in event.details.items() if isinstance(value, str)}
    return {name: names[value] for name, value in texts.items() if value in names}


def _details(
    event: AuditEvent, names: Mapping[str, str], subjects: Mapping[tuple[str, str], Subject]
) -> list[tuple[str, str]]:
    # A first attempt is the rule, a digest is for programs, and the object is an edition: the JSON has all.
    hidden = {"report_digest", "edition" if event.noun == "Edition" else ""}
    shown = {name: value for name, value in event.details.items() if name not in hidden}
    texts = {name: _words(value) for name, value in shown.items() if (name, value) != ("attempt", 1)}
    texts |= {
        name: subjects[noun, texts[name]].name
        for name, noun in _KEYS.items()
        if name in texts and (noun, texts[name]) in subjects
    }
    texts |= {name: text or "(blanked)" for name, text in named(event, names).items()}
    if texts.get("from") and texts.get("to"):
        texts = {"": f"{texts.pop('from')} → {texts.pop('to')}"} | texts
    subject = subjects.get((event.noun, event.noun_id))
    fault = subject.reason if subject and event.verb == "rejected" else ""
    texts["reason"] = texts.pop("reason", fault)  # A sentence: it comes last.
    return [(_label(name), text) for name, text in texts.items() if text]


def _label(name: str) -> str:
    return _FIELDS.get(name, name.removeprefix("is_").replace("_", " "))


def _words(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        n_more = len(value) - MAX_LISTED
        more = f" and {n_more:,} more" if n_more > 0 else ""
        return ", ".join(_label(str(each)) for each in value[:MAX_LISTED]) + more
    text = "" if value is None else _PYTHON.sub(lambda match: _WORDS[match[0]], str(value))
    if text in _CHOICES:
        return text.lower()
    text = _SPAN.sub(lambda match: span(time) if (time := parse_duration(match[0])) else "none", text)
    return _MOMENT.sub(r"\1 \2 UTC", _DIGEST.sub(r"\1…", text))


# --- from ids to names, with one question for each table -------------------------------------------------


def _subjects(events: Iterable[AuditEvent]) -> dict[tuple[str, str], Subject]:
    ids: dict[str, set[str]] = defaultdict(set)
    for event in events:
        ids[event.noun].add(event.noun_id)
        for name in _KEYS.keys() & event.details:
            ids[_KEYS[name]].add(str(event.details[name]))
    subjects: dict[tuple[str, str], Subject] = {}
    for noun, (model, related, subject_of) in _TABLES.items():
        keys = [key for key in ids[noun] if _is_key(model, key)]
        if keys:
            rows = model._default_manager.filter(pk__in=keys).select_related(*related)
            subjects |= {(noun, str(row.pk)): subject_of(row) for row in rows}
    pages = ids["Page"] & set(PAGES)
    # There is one, which its noun names already.
    subjects["SiteAnnouncement", "site"] = Subject("")
    return subjects | {
        ("Page", name): Subject(PAGES[name].title, reverse("maintain_page", args=[name])) for name in pages
    }


def _is_key(model: type[Model], text: str) -> bool:
    try:
        model._meta.pk.to_python(text)
    except ValidationError:
        return False
    return True


def _submission(row: Submission) -> Subject:
    about = f"{row.method.team.name}, submitted {row.submitted_at:%Y-%m-%d %H:%M} UTC"
    return Subject(f"{row.method.name} on {row.split.title}", reverse("submission", args=[row.pk]), about)


def _evaluation(row: Evaluation) -> Subject:
    sent = _submission(row.submission)
    reason = short_fault(row.problems[0]["message"]) if row.problems else ""
    return sent._replace(about=f"edition {row.edition.number}, {sent.about}", reason=reason)


_TABLES: Final[Mapping[str, tuple[Any, tuple[str, ...], Callable[[Any], Subject]]]] = {
    "Edition": (
        Edition,
        ("split",),
        lambda row: Subject(
            f"{row.number} of {row.split.title}", reverse("maintain_edition", args=[row.split_id, row.number])
        ),
    ),
    "Evaluation": (
        Evaluation,
        ("submission__method__team", "submission__split", "edition"),
        _evaluation,
    ),
    "Method": (
        Method,
        ("team",),
        lambda row: Subject(row.name, reverse("method", args=[row.pk]), row.team.name),
    ),
    "Split": (Split, (), lambda row: Subject(row.title, reverse("maintain_split", args=[row.pk]))),
    "Submission": (Submission, ("method__team", "split"), _submission),
    "Team": (Team, (), lambda row: Subject(row.name, reverse("maintain_team", args=[row.pk]))),
    "User": (User, (), lambda row: Subject(row.email)),
}
