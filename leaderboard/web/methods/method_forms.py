"""Forms of a method: its details and its visibility."""

from datetime import UTC, datetime
from typing import Any, Final

from django import forms
from django.http import HttpRequest

from leaderboard.methods import editing, visibility
from leaderboard.methods.details import DETAILS, Detail
from leaderboard.models import Method, Visibility
from leaderboard.web.forms import DescriptionForm, SiteForm, confirmation

_NOT_SPECIFIED: Final = ("", "not specified")


class DetailsForm(DescriptionForm):
    """Description, links, and every detail of the registry."""

    def __init__(self, *args: Any, **options: Any) -> None:
        # Subclasses that list fields of the registry could not follow it.
        super().__init__(*args, **options)
        self.fields |= {detail.name: _field_of(detail) for detail in DETAILS}

    @property
    def described(self) -> list[forms.BoundField]:
        return [self[name] for name in DescriptionForm.base_fields]

    @property
    def detailed(self) -> list[forms.BoundField]:
        return [self[detail.name] for detail in DETAILS]


class MethodForm(DetailsForm):
    name = forms.CharField(
        required=False,
        help_text="You can change it until the method is public.",
        widget=forms.TextInput(attrs={"maxlength": 80}),
    )
    field_order = ["name"]

    @classmethod
    def of_method(cls, request: HttpRequest, *, method: Method) -> "MethodForm":
        form = cls.asked(request, initial=_stated(method))
        form.fields["description"].widget.attrs["rows"] = 6
        return form

    def changes(self) -> dict[str, object]:
        """Return the posted fields; others stay as they are."""
        return {name: value for name, value in self.cleaned_data.items() if name in self.data}


def _field_of(detail: Detail) -> forms.CharField:
    kind = detail.kind
    example = detail.filter_example or detail.example
    typed = {"maxlength": kind.limits.get("max_length"), "placeholder": f"e.g. {example}"}
    return forms.CharField(
        label=detail.label,
        required=False,
        help_text=detail.help,
        widget=forms.Select(choices=[_NOT_SPECIFIED, *((each.text, each.words) for each in kind.options)])
        if kind.options
        else forms.TextInput(attrs={name: value for name, value in typed.items() if value}),
    )


def _stated(method: Method) -> dict[str, Any]:
    values = {name: getattr(method, name) for name in editing.FIELDS}
    for detail in DETAILS:
        texts = {option.value: option.text for option in detail.kind.options}
        values[detail.name] = texts.get(values[detail.name], values[detail.name])
    return values


class ShowForm(SiteForm):
    """The visibility of a method, and its confirmation."""

    visibility = forms.CharField(
        required=False,
        widget=forms.RadioSelect(choices=[(choice.value, choice.label) for choice in Visibility]),
    )
    reveal_on = forms.DateField(
        label="Becomes public on",
        required=False,
        error_messages={"invalid": "Enter a date such as 2027-03-01."},
        help_text="Optional, at 00:00 UTC. If left empty, it stays anonymous until you change it.",
        widget=forms.DateInput(attrs={"type": "date"}),
    )
    needs_day = False
    # The preview is a form, too, and asks for no tick.
    confirm = confirmation()

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.fields["confirm"].required = False

    @classmethod
    def of_method(cls, request: HttpRequest, *, method: Method) -> "ShowForm":
        """Return the posted form, or the preview that the address asks for."""
        chosen = request.GET.get("visibility", "")
        if request.method == "POST":
            form = cls(request.POST)
        elif chosen in visibility.choices(method):
            form = cls({"visibility": chosen, "reveal_on": request.GET.get("reveal_on", "")})
        else:
            # Nothing is marked but what a method with a day has already: publishing has no way back.
            marked = method.visibility if method.reveal_at else ""
            form = cls(initial={"visibility": marked, "reveal_on": _day(method.reveal_at)})
        form.needs_day = method.visibility == Visibility.ANONYMOUS and method.reveal_at is None
        if form.needs_day:
            form.fields["reveal_on"].help_text = "At 00:00 UTC on that day."
        return form

    def clean(self) -> dict[str, Any]:
        """Refuse a later day that is none, which would change nothing."""
        fields = self.cleaned_data
        is_later = self.needs_day and fields["visibility"] == Visibility.ANONYMOUS
        if is_later and fields.get("reveal_on") is None and "reveal_on" not in self.errors:
            self.add_error("reveal_on", "Enter the day on which it becomes public.")
        return fields

    def wanted(self) -> dict[str, Any]:
        """Return the arguments of the domain function: the day begins at midnight UTC."""
        chosen, day = self.cleaned_data["visibility"], self.cleaned_data["reveal_on"]
        has_day = day is not None and chosen == Visibility.ANONYMOUS
        return {
            "visibility": chosen,
            "reveal_at": datetime(day.year, day.month, day.day, tzinfo=UTC) if has_day else None,
        }

    def refuse(self, refusal: Exception) -> None:
        if getattr(refusal, "field", "") == "reveal_at":
            self.add_error("reveal_on", str(refusal))
        else:
            super().refuse(refusal)


def _day(moment: datetime | None) -> str:
    return f"{moment:%Y-%m-%d}" if moment else ""
