"""What stands above a board: which columns, which rows, and how many of them there are."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from leaderboard.models import BoxSource, Cameras
from leaderboard.standings import Board
from leaderboard.templatetags.board import grouped
from leaderboard.web.board_query import BoardQuery

_YES_NO: Final = {"yes": "yes", "no": "no"}
# In the order and under the names of `leaderboard.filters`: first what is chosen, then what is typed.
_CHOICES: Final[Mapping[str, tuple[str, Mapping[str, str]]]] = {
    "frames": ("Frames", {str(n): str(n) for n in range(2, 7)}),
    "cameras": ("Cameras", {choice.value.lower(): choice.label for choice in Cameras}),
    "boxes": ("Boxes", {choice.value.lower(): choice.label for choice in BoxSource}),
    "nerf": ("NeRF data", _YES_NO),
    "extra": ("Extra data", _YES_NO),
    "code": ("Has code", _YES_NO),
    "paper": ("Has paper", _YES_NO),
}
# Label, an example, and how many characters are seen.
_TYPED: Final[Mapping[str, tuple[str, str, int]]] = {
    "pretraining": ("Pretraining has", "ImageNet", 12),
    "parameters": ("Parameters, at most", "25M", 8),
    "latency": ("Latency, at most ms", "50", 6),
    "hardware": ("Hardware has", "RTX 4090", 12),
}


@dataclass(frozen=True)
class Choice:
    """One way to see the board, as a link."""

    label: str
    href: str
    is_current: bool


@dataclass(frozen=True)
class Chooser:
    """One filter to choose from: its options are value, label, and whether it is chosen."""

    name: str
    label: str
    options: tuple[tuple[str, str, bool], ...]


@dataclass(frozen=True)
class Typed:
    """One filter to type: a number or a text."""

    name: str
    label: str
    example: str
    size: int
    value: str


@dataclass(frozen=True)
class Tools:
    """Everything that stands above the table."""

    columns: tuple[Choice, ...]
    choosers: tuple[Chooser, ...]
    typed: tuple[Typed, ...]
    text: str
    kept: tuple[tuple[str, str], ...]
    is_filtered: bool
    sentence: str
    clear_href: str

    @property
    def has_choices(self) -> bool:
        """Whether any filter is set, besides the text to find: else they need no room."""
        chosen = any(is_chosen for chooser in self.choosers for *_, is_chosen in chooser.options)
        return chosen or any(field.value for field in self.typed)


def tools(board: Board, query: BoardQuery) -> Tools:
    """What stands above this board."""
    return Tools(
        columns=tuple(
            Choice(label, query.href(columns=value), value == query.columns.replace("both", ""))
            for value, label in (("", "both errors"), ("mid", "MiD"), ("rte", "RTE"))
        ),
        choosers=tuple(
            Chooser(
                name=name,
                label=label,
                options=tuple(
                    (value, said, query.given.get(name, "").lower() == value)
                    for value, said in options.items()
                ),
            )
            for name, (label, options) in _CHOICES.items()
        ),
        typed=tuple(
            Typed(name, label, example, size, query.given.get(name, ""))
            for name, (label, example, size) in _TYPED.items()
        ),
        text=query.filters.text,
        kept=query.kept("sort", "at", "columns"),
        is_filtered=query.filters.is_set,
        sentence=sentence(n_shown=len(board.entries), n_in_all=board.n_in_all)
        if query.filters.is_set
        else "",
        clear_href=query.href(**dict.fromkeys((*_CHOICES, *_TYPED, "q"), "")),
    )


def sentence(*, n_shown: int, n_in_all: int) -> str:
    """How many rows the filters let through.

    >>> sentence(n_shown=4, n_in_all=12), sentence(n_shown=0, n_in_all=1200)
    ('4 of 12 rows fit.', 'None of the 1,200 rows fits.')
    """
    if not n_shown:
        return f"None of the {grouped(n_in_all)} rows fits."
    return f"{grouped(n_shown)} of {grouped(n_in_all)} rows fit{'s' if n_shown == 1 else ''}."
