"""Which rows of a board to show: by what a row says of its method. Ranks stay those of the whole board."""

import math
import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import TypeVar

from leaderboard.entries import Entry
from leaderboard.keeping import ANYTHING, Parameters, one_of
from leaderboard.models import BoxSource, Cameras

NAMES = (
    *("frames", "cameras", "boxes", "nerf", "extra", "code", "paper"),
    *("pretraining", "parameters", "latency", "hardware", "q"),
)
"""What filters are called in addresses, in the order in which pages offer them."""

MAX_TEXT = 80
_T = TypeVar("_T")
_YES_NO = {"yes": True, "no": False}
_CAMERAS = {choice.value.lower(): choice.value for choice in Cameras}
_BOXES = {choice.value.lower(): choice.value for choice in BoxSource}
_FRAMES = {str(n): n for n in range(2, 7)}
# Nobody writes "25000000" by hand; without a letter it is the number itself.
_COUNT = re.compile(r"([0-9]{1,16}(?:\.[0-9]{1,6})?) ?([kmb]?)", re.ASCII | re.IGNORECASE)
_TIMES = {"": 1, "k": 10**3, "m": 10**6, "b": 10**9}


PARAMETERS: Parameters = {
    **{name: one_of("", *_YES_NO) for name in ("nerf", "extra", "code", "paper")},
    "frames": one_of("", *_FRAMES),
    "cameras": one_of("", *_CAMERAS),
    "boxes": one_of("", *_BOXES),
    **dict.fromkeys(("pretraining", "parameters", "latency", "hardware", "q"), ANYTHING),
}
"""Which of their values are worth remembering a board for: choices are few, texts and limits are not."""


class BadFilter(ValueError):
    """A filter has a value that it does not take. `field` is its name."""

    def __init__(self, field: str, found: str, expected: str) -> None:
        super().__init__(f"The filter '{field}' is {found[:60]!r}; expected {expected}.")
        self.field = field


@dataclass(frozen=True)
class Filters:
    """What a row has to say to be shown. None or empty lets everything through.

    A row of which a thing is not said fits no filter for it, neither yes nor no.
    """

    frames: int | None = None
    cameras: str = ""
    boxes: str = ""
    nerf: bool | None = None
    extra: bool | None = None
    code: bool | None = None
    paper: bool | None = None
    pretraining: str = ""  # in what it says of it
    n_parameters: int | None = None  # at most
    latency_ms: float | None = None  # at most
    hardware: str = ""  # in what it says of it
    text: str = ""  # in the names of method and team

    @property
    def is_set(self) -> bool:
        """Whether anything is asked for."""
        return self != Filters()

    def admits(self, entry: Entry) -> bool:
        """Whether the row is to be shown. It is asked for what it says, so a masked row betrays nothing."""
        details = entry.details
        wanted = (
            (self.frames, details.n_frames),
            (self.cameras or None, details.cameras),
            (self.boxes or None, details.box_source),
            (self.nerf, details.uses_nerf),
            (self.extra, details.uses_extra_data),
            (self.code, bool(entry.code_url)),
            (self.paper, bool(entry.paper_url)),
        )
        if any(value is not None and value != said for value, said in wanted):
            return False
        limits = ((self.n_parameters, details.n_parameters), (self.latency_ms, details.latency_ms))
        if any(most is not None and (said is None or said > most) for most, said in limits):
            return False
        texts = (
            (self.pretraining, details.pretraining),
            (self.hardware, details.hardware),
            (self.text, f"{entry.method}\n{entry.team}"),
        )
        return all(_folded(text) in _folded(said) for text, said in texts if text)


def parse(query: Mapping[str, str]) -> Filters:
    """The filters that an address names; empty values are none, and other names are not looked at.

    Raises `BadFilter`.
    """
    given = {name: query[name].strip() for name in NAMES if query.get(name, "").strip()}
    return Filters(
        frames=_choice(given, "frames", _FRAMES),
        cameras=_choice(given, "cameras", _CAMERAS) or "",
        boxes=_choice(given, "boxes", _BOXES) or "",
        nerf=_choice(given, "nerf", _YES_NO),
        extra=_choice(given, "extra", _YES_NO),
        code=_choice(given, "code", _YES_NO),
        paper=_choice(given, "paper", _YES_NO),
        pretraining=_text(given, "pretraining"),
        n_parameters=_count(given, "parameters"),
        latency_ms=_latency(given),
        hardware=_text(given, "hardware"),
        text=_text(given, "q"),
    )


def _choice(given: Mapping[str, str], name: str, choices: Mapping[str, _T]) -> _T | None:
    if name not in given:
        return None
    found = given[name].lower()
    if found not in choices:
        raise BadFilter(name, given[name], f"one of {', '.join(choices)}")
    return choices[found]


def _latency(given: Mapping[str, str]) -> float | None:
    if "latency" not in given:
        return None
    expected = "a number of milliseconds above 0"
    try:
        value = float(given["latency"])
    except ValueError:
        raise BadFilter("latency", given["latency"], expected) from None
    if not math.isfinite(value) or value <= 0:
        raise BadFilter("latency", given["latency"], expected)
    return value


def _count(given: Mapping[str, str], name: str) -> int | None:
    if name not in given:
        return None
    found = _COUNT.fullmatch(given[name])
    value = int(Decimal(found[1]) * _TIMES[found[2].lower()]) if found else 0
    if not value:
        raise BadFilter(name, given[name], "a number above 0, such as 25M (million), 400k or 25000000")
    return value


def _text(given: Mapping[str, str], name: str) -> str:
    text = given.get(name, "")
    if len(text) > MAX_TEXT:
        raise BadFilter(name, text, f"at most {MAX_TEXT} characters, found {len(text)}")
    return text


def _folded(text: str) -> str:
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", text).casefold())
