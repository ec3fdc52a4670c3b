"""Forms of published results: one row typed in, or a paper's document pasted or uploaded."""

import json
import re
from typing import Any, Final

from django import forms
from django.db.models import QuerySet
from django.utils.text import slugify

from evaluator.metrics.protocol import DEFAULT_PROTOCOL, Protocol, get_protocol
from leaderboard.editions import papers, splits
from leaderboard.editions.papers import BadDocument
from leaderboard.models import Split
from leaderboard.web.forms import SiteForm
from leaderboard.web.maintain.maintainer_forms import reason_field

# The field of the form for the place in the document that is made from it.
_FIELDS: Final = {
    "/source/": ("title", "authors", "year", "url", "table", "code"),
    "/methods/0/": ("name",),
}
_NOT_PRINTED: Final = frozenset({"-", "–", "—", "null"})


def _text(label: str, *, is_required: bool = True, **attrs: str) -> forms.CharField:
    return forms.CharField(
        label=label,
        required=is_required,
        widget=forms.TextInput(attrs={"autocomplete": "off", **attrs}),
    )


def _replacing(rows: str) -> forms.BooleanField:
    return forms.BooleanField(label=f"Replace {rows}", required=False)


class RowForm(SiteForm):
    """A row of one paper on one board."""

    split = forms.ChoiceField(choices=lambda: [(row.pk, row.title) for row in Split.objects.all()])
    name = _text("Method", maxlength="80")
    title = _text("Title of the paper")
    authors = _text("Authors, separated by commas")
    year = forms.IntegerField(widget=forms.NumberInput(attrs={"inputmode": "numeric"}))
    url = _text("Link to the paper", placeholder="https://")
    table = _text("Table or section", placeholder="Table 2")
    code = _text("Link to the code (optional)", is_required=False, placeholder="https://")
    scores = forms.CharField(widget=forms.Textarea(attrs={"spellcheck": "false", "class": "digest"}))
    is_replacing = _replacing("the existing row of this method")

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        protocol = _protocol_of(_first_split())
        n_lines, n_each = len(protocol.metrics), len(protocol.range_names)
        self.fields["scores"].help_text = (
            f"{n_lines} lines: {', '.join(metric.symbol for metric in protocol.metrics)}. "
            f"{n_each} numbers in each, separated by spaces: {', '.join(protocol.range_names)}. "
            "Where the paper gives no number, write –."
        )
        self.fields["scores"].widget.attrs["rows"] = n_lines

    def document(self) -> dict[str, Any]:
        """Return the document of this row. Raises `BadDocument` for a score that is no number."""
        fields = self.cleaned_data
        slug = slugify(fields["name"]) or "row"
        protocol = _protocol_of(_splits().get(pk=fields["split"]))
        return {
            "source": {name: fields[name] for name in _FIELDS["/source/"]},
            "columns": list(protocol.score_names),
            "methods": [{"slug": slug, "name": fields["name"]}],
            "results": {fields["split"]: {slug: [_score(each) for each in fields["scores"].split()]}},
        }

    def refuse(self, refusal: Exception) -> None:
        """Show every problem of the document at the field that it came from."""
        for problem in refusal.problems if isinstance(refusal, BadDocument) else ():
            where, _, sentence = problem.partition(": ")
            names = [start + name for start, names in _FIELDS.items() for name in names]
            field = where.rpartition("/")[2] if where in names else "scores"
            self.add_error(field, sentence or problem)
        if not isinstance(refusal, BadDocument):
            super().refuse(refusal)


def _splits() -> QuerySet[Split]:
    return Split.objects.select_related("current_edition")


def _first_split() -> Split | None:
    return _splits().exclude(current_edition=None).first() or _splits().first()


def _protocol_of(split: Split | None) -> Protocol:
    edition = split.current_edition if split else None
    return get_protocol(edition.protocol if edition else DEFAULT_PROTOCOL)


def example() -> str:
    """Return a document that can be imported as it is."""
    split = _first_split()
    columns = _protocol_of(split).score_names
    source = {"title": "Later", "authors": "L. Ater, E. Arly", "year": 2026, "table": "Table 2"}
    parts = {
        "source": source | {"url": "https://example.org/later"},
        "columns": columns,
        "methods": [{"slug": "later", "name": "Later"}],
        "results": {split.pk if split else "": {"later": [14.0, *[None] * (len(columns) - 1)]}},
    }
    return "{\n" + ",\n".join(f'"{name}": {json.dumps(part)}' for name, part in parts.items()) + "\n}"


def _score(text: str) -> float | None:
    if text in _NOT_PRINTED:
        return None
    if not re.fullmatch(r"[0-9]+(\.[0-9]+)?", text):
        raise BadDocument([f"/results: {text[:40]!r}; expected a number such as 14.0, or a dash."])
    return float(text)


class PaperForm(SiteForm):
    text = forms.CharField(
        label="JSON document",
        required=False,
        strip=False,
        help_text="With source, columns, methods and results. Paste it here, or choose a file below.",
        widget=forms.Textarea(attrs={"rows": 8, "spellcheck": "false", "class": "digest"}),
    )
    file = forms.FileField(
        label="File",
        required=False,
        widget=forms.FileInput(attrs={"accept": ".json,application/json"}),
        error_messages={"empty": "The document is empty; expected JSON."},
    )
    is_replacing = _replacing("the existing rows of these methods")

    def refuse(self, refusal: Exception) -> None:
        """Show every problem of the document at its field."""
        for problem in refusal.problems if isinstance(refusal, BadDocument) else ():
            self.add_error("file" if self.files.get("file") else "text", problem)
        if not isinstance(refusal, BadDocument):
            super().refuse(refusal)

    def document(self) -> dict[str, Any]:
        """Parse the document. Raises `BadDocument`."""
        file, text = self.cleaned_data["file"], self.cleaned_data["text"]
        if not file and not text.strip():
            raise BadDocument(["No document was sent; expected JSON in the field, or a file."])
        return papers.parse(file.read(papers.MAX_BYTES + 1) if file else text.encode())


class RemovalForm(SiteForm):
    reason = reason_field("One sentence for the audit log.", max_length=splits.MAX_REASON)
