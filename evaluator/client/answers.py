"""Answers of the leaderboard's API: the fields that the command reads, and the whole as `document`."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import msgspec

from evaluator.problems import FileWarning, Problem
from evaluator.scoring.significance import Difference
from evaluator.units import RECORDING

FINAL_STATES = frozenset({"SCORED", "REJECTED", "SYSTEM_ERROR", "CANCELLED"})

JSON = dict[str, Any]


class Queue(msgspec.Struct, frozen=True):
    """The number of evaluations ahead of this one."""

    ahead: int


class Submission(msgspec.Struct, frozen=True, kw_only=True):
    """A submission. `is_new` is False if the same file was submitted before; `notes` name a probable slip.

    `rank` is its method's rank if the board shows this submission; a private method's is the rank it would
    have. With `awaits_intervals`, the intervals follow within seconds.
    """

    id: str
    state: str
    document: JSON
    split: str = ""
    method: str = ""
    method_id: str | None = None
    url: str | None = None
    visibility: str = ""
    notice: str = ""
    withdrawn_at: str | None = None
    scores: dict[str, float | None] | None = None
    decimals: int = 2
    intervals: dict[str, ConfidenceInterval] = {}
    awaits_intervals: bool = False
    rank: int | None = None
    counts: dict[str, int] | None = None
    n_out_of_range: int | None = None
    truncated: dict[str, int] | None = None
    warnings: list[FileWarning] = []
    problems: list[Problem] = []
    n_problems: int | None = None
    queue: Queue | None = None
    notes: list[str] = []
    is_new: bool = True

    @property
    def is_final(self) -> bool:
        """Whether its state is final."""
        return self.state in FINAL_STATES


class Method(msgspec.Struct, frozen=True, kw_only=True):
    """A method; `notice` says who sees its results."""

    id: str
    name: str
    document: JSON
    visibility: str = ""
    notice: str = ""
    pseudonym: str | None = None
    reveal_at: str | None = None
    url: str = ""


class Account(msgspec.Struct, frozen=True, kw_only=True):
    """The owner of a token; without a `split` it is valid for all."""

    team: str | None
    token: str | None
    scopes: list[str]
    document: JSON
    split: str | None = None
    expires_at: str | None = None


class ConfidenceInterval(msgspec.Struct, frozen=True, kw_only=True):
    """The 95% interval of a value and of its rank; None if unknown, and `reason` says why."""

    low: float | None = None
    high: float | None = None
    rank_low: int | None = None
    rank_high: int | None = None
    reason: str = ""


class BoardEntry(msgspec.Struct, frozen=True, kw_only=True):
    """A row of a board: scores by name, None where a TTC range has no value.

    `id` is permanent: a method's id, or `published:deep-scale`. `decimals` are those of its values.
    `pseudonym` is the name that others see for an anonymous row of your team, else None.
    """

    method: str
    scores: dict[str, float | None]
    id: str | None = None
    decimals: int = 2
    method_id: str | None = None
    rank: int | None = None
    team: str | None = None
    date: str | None = None
    kind: str = "submission"
    visibility: str = "PUBLIC"
    pseudonym: str | None = None
    intervals: dict[str, ConfidenceInterval] = {}

    def interval(self, score: str) -> ConfidenceInterval:
        """Return the interval of one score, without ends if unknown."""
        return self.intervals.get(score, ConfidenceInterval())


class Board(msgspec.Struct, frozen=True, kw_only=True):
    """The ranked entries of a split in an edition.

    `floor` are the ground truth's own scores, `unit` and `n_units` the independent units of intervals and
    ranks; they and `edition` are None before the first edition.
    """

    split: str
    entries: list[BoardEntry]
    document: JSON
    edition: Any = None
    decimals: int | None = None
    unit: str | None = RECORDING
    n_units: int | None = None
    floor: dict[str, float | None] | None = None
    updated_at: str | None = None

    @property
    def score_names(self) -> tuple[str, ...]:
        """The names of its scores, in the server's order."""
        return tuple(dict.fromkeys(name for entry in self.entries for name in entry.scores))

    @property
    def updated(self) -> str:
        """The time of its last change, to the second, or its day for an anonymous row; empty if unknown."""
        # The end of a day stands for that day.
        return re.sub(r"T23:59:59\.999999Z$|\.\d+", "", self.updated_at or "")


class RankChange(msgspec.Struct, frozen=True, kw_only=True):
    """Another row whose rank changes."""

    method: str
    rank_before: int | None = None
    rank_after: int | None = None


class BoardPreview(msgspec.Struct, frozen=True, kw_only=True):
    """A split's future board: its row before (None without one) and after, and the rank changes."""

    split: str
    after: BoardEntry
    before: BoardEntry | None = None
    n_ranked: int | None = None
    moved: list[RankChange] = []


class VisibilityPreview(msgspec.Struct, frozen=True, kw_only=True):
    """A preview of a method's public rows."""

    name: str
    document: JSON
    team: str = ""
    splits: list[BoardPreview] = []


class Pair(msgspec.Struct, frozen=True, kw_only=True):
    """Two methods and their differences by score name; None until a worker has computed them."""

    differences: dict[str, Difference | None] | None = None
    sentence: str = ""


class Compared(msgspec.Struct, frozen=True, kw_only=True):
    """A comparison of methods; `reason` explains missing intervals."""

    document: JSON
    split: str = ""
    edition: Any = None
    pairs: list[Pair] = []
    decimals: int = 2
    is_complete: bool = True
    reason: str = ""
    unit: str = RECORDING
    n_units: int | None = None

    def differences(self) -> dict[str, Difference]:
        """The differences of the first computed pair, by score name."""
        by_name = (self.pairs[0].differences or {}) if self.pairs else {}
        return {name: difference for name, difference in by_name.items() if difference is not None}


class Quota(msgspec.Struct, frozen=True, kw_only=True):
    """Your team's remaining submissions to a split. None: no limit."""

    split: str
    document: JSON
    limit: int | None = None
    left: int | None = None
    next_slot_at: str | None = None
    is_open: bool = True
    sentence: str = ""


class ClientError(Exception):
    """A failure of a request."""


@dataclass(kw_only=True, eq=False)
class Unreachable(ClientError):
    """An incomplete answer: nothing listens, the name is unknown, the connection broke, time ran out."""

    url: str
    reason: str
    was_connected: bool  # whether the server had been reached at all
    is_lasting: bool = False  # whether the next try would end the same way

    def __str__(self) -> str:
        return f"no answer from {self.url}: {self.reason}"


@dataclass(kw_only=True, eq=False)
class NotSecure(Unreachable):
    """A server that answers, but not over TLS, or with a certificate that this machine does not trust."""

    is_untrusted: bool


@dataclass(kw_only=True, eq=False)
class BadSurroundings(ClientError):
    """A proxy or certificates that the environment names and nobody can use; `hint` is the next step."""

    url: str
    reason: str
    hint: str

    def __str__(self) -> str:
        return self.reason


@dataclass(kw_only=True, eq=False)
class Refused(ClientError):
    """An error status with the server's `problems`."""

    url: str
    status: int
    title: str = ""
    detail: str = ""
    code: str = ""
    problems: tuple[Problem, ...] = ()
    retry_after_s: float | None = None
    document: JSON | None = None

    def __str__(self) -> str:
        return f"{self.url} answered {self.status}: {self.detail or self.title}"


@dataclass(kw_only=True, eq=False)
class BadAnswer(ClientError):
    """A response that did not come from a leaderboard: not JSON, of another shape, or a redirect."""

    # Following a redirect could send the token to another server.

    url: str
    content: str

    def __str__(self) -> str:
        return f"{self.url} gave an unexpected answer: {self.content}"


@dataclass(kw_only=True, eq=False)
class TimedOut(ClientError):
    """The end of a wait for the workers; `submission` is the last known state."""

    what: str
    timeout_s: float
    submission_id: str = ""
    submission: Submission | None = None

    def __str__(self) -> str:
        return f"{self.what} after {self.timeout_s:g} s"
