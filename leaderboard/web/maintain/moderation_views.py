"""Moderation for maintainers: a team with its people, methods and entries; each action has a page."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final
from uuid import UUID

from allauth.account.adapter import get_adapter
from allauth.account.decorators import reauthentication_required
from django import forms
from django.contrib import messages
from django.core.exceptions import ValidationError
from django.db.models import Prefetch, Q, QuerySet
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.views.decorators.http import require_safe

from leaderboard.errors.refusals import Refused
from leaderboard.models import Evaluation, Method, Submission, Team, User
from leaderboard.moderation import forgetting, hiding, takeovers
from leaderboard.moderation.hiding import MAX_REASON
from leaderboard.people import teams, tokens
from leaderboard.people.names import MAX_NAME
from leaderboard.submissions import outcomes
from leaderboard.web.forms import SiteForm, confirmation
from leaderboard.web.maintain.maintainer_forms import reason_field
from leaderboard.web.maintain.maintainer_views import (
    form_page,
    maintainer_of,
    maintainers_form,
    maintainers_only,
)
from leaderboard.web.submissions.forms import parse_uuid


class ActionForm(SiteForm):
    reason = reason_field(
        "One sentence for the audit log, without names and addresses. The team does not see it.",
        max_length=MAX_REASON,
    )


class FinalActionForm(ActionForm):
    confirm = confirmation()


class RenameForm(ActionForm):
    how = forms.ChoiceField(
        label="What to do",
        choices=[("rename", "Rename: give it the name below"), ("mask", "Mask: give it a neutral name")],
        widget=forms.RadioSelect,
        error_messages={"required": "Nothing was chosen; expected to rename or to mask."},
    )
    name = forms.CharField(
        label="New name",
        required=False,
        max_length=MAX_NAME,
        help_text="Only to rename. To mask, leave it empty: the site makes a name, such as Team 3f9c2a.",
        widget=forms.TextInput(attrs={"autocomplete": "off"}),
    )

    field_order = ("how", "name", "reason")

    def clean(self) -> dict[str, Any]:
        fields: dict[str, Any] = super().clean() or {}
        is_masked = fields.pop("how", "") == "mask"
        if not is_masked and not fields.get("name") and not self.errors:
            self.add_error("name", "No new name was given; expected one, or to mask the present one.")
        return fields | ({"name": ""} if is_masked else {})


class MoveForm(ActionForm):
    name = forms.CharField(
        label="New team",
        max_length=MAX_NAME,
        help_text="Name of the team as the boards show it, or its id.",
        error_messages={"required": "No team was named; expected its name or its id."},
        widget=forms.TextInput(attrs={"autocomplete": "off"}),
    )

    field_order = ("name", "reason")


class GiveBackForm(ActionForm):
    address = forms.EmailField(
        label="Email address of the owner",
        help_text="The account then has this address alone. Check first that the account is theirs.",
        error_messages={"required": "No address was given; expected that of the owner of the account."},
        widget=forms.EmailInput(attrs={"autocomplete": "off"}),
    )

    field_order = ("address", "reason")

    def clean_address(self) -> str:
        address: str = get_adapter().clean_email(self.cleaned_data["address"].lower())
        return address


MAX_ENTRIES: Final = 200
_RENAMED: Final = (
    "The new name replaces the old one on all boards, including those of earlier dates, in exports, feeds, "
    "pictures and search."
)


@dataclass(frozen=True)
class Action:
    """An action of a maintainer: the words of its page, those of its success, and its function."""

    model: type[Team | Method | Submission | User]
    heading: str
    lead: str
    button: str
    done: str
    form: type[ActionForm]
    do: Callable[..., object]
    destroys: bool = False
    # Whether the maintainer must have confirmed within some minutes who they are.
    asks_who: bool = False


def _move(*, subject: Method, name: str, now: object, **arguments: Any) -> None:
    by_id = Q(pk=parse_uuid(name)) if parse_uuid(name) else Q()
    matches = list(Team.objects.filter(Q(name=name) | by_id)[:2]) if name else []
    if len(matches) != 1:
        how = "Several teams are" if matches else "No team is"
        raise Refused(
            "bad-value", f"{how} called {name!r}; expected the name or the id of one team.", field="name"
        )
    hiding.move_method(method=subject, to=matches[0], **arguments)


def _appoint(*, subject: User, now: object, **arguments: Any) -> None:
    team = _team_of(subject)
    if team is None:
        raise Refused("bad-value", "The person is in no team; expected a member of a team.")
    teams.appoint(team=team, to=subject, **arguments)


ACTIONS: Final[Mapping[str, Action]] = {
    "rename-team": Action(
        Team,
        "Rename the team",
        _RENAMED,
        "Rename",
        "The team is renamed.",
        RenameForm,
        lambda subject, **arguments: hiding.rename_team(team=subject, **arguments),
    ),
    "rename-method": Action(
        Method,
        "Rename the method",
        _RENAMED,
        "Rename",
        "The method is renamed.",
        RenameForm,
        lambda subject, **arguments: hiding.rename_method(method=subject, **arguments),
    ),
    "clear-texts": Action(
        Method,
        "Delete the texts of the method",
        "Description, paper link and code link are deleted. The team can write new ones.",
        "Delete texts",
        "The texts are deleted.",
        ActionForm,
        lambda subject, now, **arguments: hiding.clear_texts(method=subject, **arguments),
        destroys=True,
    ),
    "move-method": Action(
        Method,
        "Move the method to another team",
        "The method, its submissions and its history belong to the other team from now on.",
        "Move",
        "The method is moved.",
        MoveForm,
        _move,
    ),
    "withdraw": Action(
        Submission,
        "Withdraw the submission",
        "Its scores are removed from every edition. Its row remains on the board, marked with the date. This "
        "cannot be undone.",
        "Withdraw",
        "The submission is withdrawn.",
        FinalActionForm,
        lambda subject, **arguments: hiding.withdraw_entry(submission=subject, is_hidden=False, **arguments),
        destroys=True,
    ),
    "hide": Action(
        Submission,
        "Remove the submission",
        "Its scores and its row are removed from all boards, including those of past days. Its team still "
        "sees it as withdrawn. This cannot be undone.",
        "Remove",
        "The submission is removed.",
        FinalActionForm,
        lambda subject, **arguments: hiding.withdraw_entry(submission=subject, is_hidden=True, **arguments),
        destroys=True,
    ),
    "appoint-owner": Action(
        User,
        "Make the person the owner of the team",
        "They own the team from now on, in place of the present owner, who stays a member.",
        "Make owner",
        "The person now owns the team.",
        ActionForm,
        _appoint,
    ),
    "close-account": Action(
        User,
        "Close the account",
        "Nobody can sign in to it or use its tokens. Its entries remain on the board.",
        "Close account",
        "The account is closed.",
        ActionForm,
        lambda subject, now, **arguments: hiding.set_active(user=subject, is_active=False, **arguments),
    ),
    "open-account": Action(
        User,
        "Open the account again",
        "The person can sign in again.",
        "Open account",
        "The account is open again.",
        ActionForm,
        lambda subject, now, **arguments: hiding.set_active(user=subject, is_active=True, **arguments),
    ),
    "give-back-account": Action(
        User,
        "Give the account back",
        "For an account that someone else took over. The address below becomes its only one. The password, "
        "all sessions, API tokens, two-factor authentication and connected accounts end. We email the owner "
        "how to choose a new password, and tell the former addresses.",
        "Give account back",
        "The account is given back.",
        GiveBackForm,
        lambda subject, **arguments: takeovers.give_back(user=subject, **arguments),
        destroys=True,
        asks_who=True,
    ),
    "revoke-tokens": Action(
        User,
        "Revoke the API tokens of the person",
        "All of them end at once. The person can create new ones.",
        "Revoke tokens",
        "The tokens are revoked.",
        ActionForm,
        lambda subject, **arguments: tokens.revoke_all(user=subject, **arguments),
    ),
    "forget-person": Action(
        User,
        "Forget the person",
        "The account, its addresses, tokens and invitations are deleted, also file names and notes. "
        "A team without other members loses its name. Scores remain on the board. This cannot be undone.",
        "Forget person",
        "The person is forgotten.",
        FinalActionForm,
        lambda subject, **arguments: forgetting.forget(user=subject, **arguments),
        destroys=True,
    ),
}


@maintainers_only
@require_safe
def team(request: HttpRequest, team_id: UUID) -> HttpResponse:
    row = get_object_or_404(Team, pk=team_id)
    sent = Submission.objects.filter(method__team=row).select_related("method", "split")
    context = {
        "team": row,
        "members": row.memberships.select_related("user").order_by("joined_at"),
        "methods": Method.objects.existing().filter(team=row).order_by("name"),
        "n_sent": sent.count(),
        "sent": _with_states(sent.order_by("-submitted_at")[:MAX_ENTRIES]),
    }
    return render(request, "maintain/team.html", context)


def _with_states(sent: QuerySet[Submission]) -> list[Submission]:
    rows = list(
        sent.prefetch_related(Prefetch("evaluations", Evaluation.objects.defer("report", "problems")))
    )
    for row in rows:
        by_edition: dict[int | None, Evaluation] = {each.edition_id: each for each in row.evaluations.all()}
        row.evaluation = by_edition.get(row.split.current_edition_id)  # type: ignore[attr-defined]  # for the template
        row.can_be_withdrawn = outcomes.can_be_withdrawn(row)  # type: ignore[attr-defined]  # likewise
        row.spoken = f" {row.method.name}, {row.split_id}"  # type: ignore[attr-defined]  # likewise
    return rows


@maintainers_form
def action(request: HttpRequest, action_name: str, subject_id: str) -> HttpResponse:
    if action_name not in ACTIONS:
        raise Http404
    chosen = ACTIONS[action_name]
    try:
        subject: Any = get_object_or_404(chosen.model, pk=chosen.model._meta.pk.to_python(subject_id))
    except ValidationError as fault:
        raise Http404 from fault
    form: SiteForm = chosen.form.asked(request)
    team = _team_of(subject)
    if form.is_valid():
        with form.refusals():
            given = {name: value for name, value in form.cleaned_data.items() if name != "confirm"}
            arguments = {**given, "actor": maintainer_of(request), "now": timezone.now()}
            (_confirmed if chosen.asks_who else _done)(request, chosen, subject, arguments)
            messages.success(request, chosen.done)
            return redirect("maintain_team", team.pk) if team else redirect("maintain_teams")
    back = reverse("maintain_team", args=[team.pk]) if team else reverse("maintain_teams")
    about = {"action": chosen, "subject": _name_of(subject), "team": team, "back": back}
    return form_page(request, "maintain/action.html", form, **about)


def _done(request: HttpRequest, chosen: Action, subject: Any, arguments: Mapping[str, Any]) -> None:
    chosen.do(subject=subject, **arguments)


_confirmed = reauthentication_required(_done)


def _team_of(subject: Team | Method | Submission | User) -> Team | None:
    if isinstance(subject, Team):
        return subject
    if isinstance(subject, User):
        return teams.current_team_of(user=subject)
    return subject.method.team if isinstance(subject, Submission) else subject.team


def _name_of(subject: Team | Method | Submission | User) -> str:
    if isinstance(subject, Submission):
        return f"{subject.method.name} on {subject.split.title}, {subject.submitted_at:%Y-%m-%d %H:%M} UTC"
    return subject.email if isinstance(subject, User) else subject.name
