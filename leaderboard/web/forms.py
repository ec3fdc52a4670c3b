"""The base of all forms."""

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final, Self
from urllib.parse import urlencode

from django import forms
from django.http import HttpRequest
from django.utils.datastructures import MultiValueDict

from leaderboard.errors.refusals import Refused, doubled_field

_ADDRESS: Final = {"placeholder": "https://", "maxlength": 500}
_OF_MANY: Final = (forms.MultipleChoiceField, forms.ModelMultipleChoiceField)


class SiteForm(forms.Form):
    """A form of the site. Most checks are left to the domain function."""

    @classmethod
    def asked(cls, request: HttpRequest, **options: Any) -> Self:
        """Return the form with a request's data, or with its initial values."""
        return cls(request.POST if request.method == "POST" else None, **options)

    def full_clean(self) -> None:
        """Check the fields; refuse one that comes twice: Django keeps the last one alone."""
        super().full_clean()
        if not self.is_bound:
            return
        for name, field in self.fields.items():
            n_given = sum(len(sent.getlist(self.add_prefix(name))) for sent in self._sent())
            if n_given > 1 and not isinstance(field, _OF_MANY):
                self.refuse(doubled_field(name, n_given=n_given))

    def _sent(self) -> list[MultiValueDict[str, Any]]:
        return [sent for sent in (self.data, self.files) if isinstance(sent, MultiValueDict)]

    @property
    def ignored(self) -> list[str]:
        """Return the parameters of an address that are no field of the form, but for the number of a page."""
        return [name for name in self.data if name not in self.fields and name != "page"]

    def refuse(self, refusal: Exception) -> None:
        """Put the advice, or else the message, at the field at fault; above all for a hidden one."""
        field = getattr(refusal, "field", "")
        if field in self.fields and not self.fields[field].widget.is_hidden:
            self.add_error(field, getattr(refusal, "advice", "") or str(refusal))
        else:
            self.add_error(None, str(refusal))

    @contextmanager
    def refusals(self) -> Iterator[None]:
        """Show a `Refused` on the form."""
        try:
            yield
        except Refused as refusal:
            self.refuse(refusal)

    def query(self, **more: Any) -> str:
        """Return the values as a query, with `more`."""
        asked = {**self.cleaned_data, **more}
        return urlencode({name: str(value) for name, value in asked.items() if value})


class AskingForm(SiteForm):
    """A form that may ask before it does what it is for: `sentences` is the question, once it was sent."""

    confirmed = forms.CharField(required=False, widget=forms.HiddenInput())
    sentences: Sequence[str] = ()

    @property
    def answer(self) -> str:
        """Return what confirms these sentences alone."""
        return hashlib.sha256("\0".join(self.sentences).encode()).hexdigest()[:32]

    def asks(self, sentences: Sequence[str]) -> bool:
        """Tell whether these sentences are to be confirmed first."""
        self.sentences = sentences
        return bool(sentences) and self.cleaned_data["confirmed"] != self.answer


def confirmation() -> forms.BooleanField:
    """Return the tick that every step without a way back asks for."""
    return forms.BooleanField(
        label="I understand that this cannot be undone.",
        error_messages={"required": "Confirm that this cannot be undone: tick the box."},
    )


class ConfirmForm(SiteForm):
    confirm = confirmation()


class DescriptionForm(SiteForm):
    description = forms.CharField(
        required=False,
        help_text="One or two sentences: what the method does, and its inputs. `Backticks` mark code.",
        widget=forms.Textarea(attrs={"rows": 4, "maxlength": 2000}),
    )
    paper_url = forms.CharField(label="Paper", required=False, widget=forms.URLInput(attrs=_ADDRESS))
    code_url = forms.CharField(label="Code", required=False, widget=forms.URLInput(attrs=_ADDRESS))
