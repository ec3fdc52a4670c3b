"""Forms of moderation: a reason, and what the deed needs beside it."""

from django import forms

from leaderboard.people.names import MAX_NAME
from leaderboard.submissions.moderation import MAX_REASON
from leaderboard.web.forms import SiteForm
from leaderboard.web.maintain.maintainer_forms import reason_field


class DeedForm(SiteForm):
    """Why."""

    reason = reason_field(
        "One sentence for the audit log, without names and addresses. The team does not see it.",
        max_length=MAX_REASON,
    )


class RenameForm(DeedForm):
    """Another name, or none."""

    name = forms.CharField(
        label="New name",
        required=False,
        max_length=MAX_NAME,
        help_text="Empty: a name that says nothing, such as Team 3f9c2a.",
        widget=forms.TextInput(attrs={"autocomplete": "off"}),
    )

    field_order = ("name", "reason")


class MoveForm(DeedForm):
    """Which team."""

    name = forms.CharField(
        label="New team",
        max_length=MAX_NAME,
        help_text="Name of the team as the boards show it, or its id.",
        error_messages={"required": "No team was named; expected its name or its id."},
        widget=forms.TextInput(attrs={"autocomplete": "off"}),
    )

    field_order = ("name", "reason")
