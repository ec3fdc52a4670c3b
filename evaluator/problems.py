"""Problems of a file: `Problem`, and `Rejected`, which carries a list of them."""

# A message states what, where, found and expected, equally on page, API and command line.

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Final

from evaluator.counting import counted

MAX_LISTED: Final = 20
"""At most so many lines of one kind, or places in one line, are listed; the rest are counted."""

_MAX_QUOTED: Final = 60

# Of a rejection that another process has written. A message has at most 21 pointers, of 2,400 characters each
# where all of them have to be escaped; a place may be a path.
_MAX_LINES: Final = 1000
_MAX_COUNTED: Final = 10**9
_MAX_CHARS: Final = {"code": 100, "message": 60_000, "where": 10_000}

PROBLEM_CODES: Final[dict[str, str]] = {
    # prediction files
    "too-large": "The file is larger than the limit.",
    "not-utf8": "The file is not UTF-8 text.",
    "too-deep": "Objects and lists are nested deeper than any prediction file needs.",
    "too-many-members": (
        "The file has far more values, rows, columns or gzip members than one for the manifest needs."
    ),
    "not-json": "The text is not JSON.",
    "wrong-top-level": "The outermost value, or `predictions`, is not an object.",
    "unknown-field": "The envelope has a field that the format does not know.",
    "unknown-unit": 'The envelope\'s `unit` is missing or neither "ttc" nor "scale_ratio".',
    "missing-predictions": "The envelope has no `predictions`.",
    "bad-rate": "`fps` or `frame_gap` is missing, duplicated, unexpected or invalid.",
    "bad-meta": "`meta` is not a plain JSON object of at most 64 KiB.",
    "missing-keys": (
        "Sequences of the manifest have no prediction; or a correction added them after the file was sent."
    ),
    "unknown-keys": "Predictions are given for sequences that the manifest does not have.",
    "duplicate-keys": "A key appears more than once.",
    "mixed-keys": "The file mixes anno_ids with natural keys.",
    "not-a-number": "A value is a string, null, a boolean, a list or an object.",
    "nan": "A value is NaN.",
    "zero": "A time to contact is 0 (or too small for a float64), where both errors are meaningless.",
    "not-positive": "A scale ratio is not greater than 0.",
    "undefined-error": "Under the protocol `toolkit`, a prediction from −0.1 to 0 s has no defined MiD.",
    # prediction files, ground truth and manifests
    "unreadable": "The file or folder cannot be read, or is of no known kind.",
    "bad-csv": "The text is not a CSV table.",
    "missing-columns": "The table lacks columns.",
    "bad-field": "A field of a row is empty, malformed or out of range.",
    # ground truth and manifests
    "empty": "The table has no sequences.",
    "duplicate-ids": "An anno_id appears more than once.",
    "duplicate-natural-keys": "A natural key appears more than once.",
    "truth-not-finite": "A true time to contact is NaN or infinite.",
    "two-units": "A recording has two units; a unit, such as a day, must contain whole recordings.",
    "truth-near-zero": "A true time to contact lies where the errors are undefined (−0.1 ≤ τ ≤ 0, or "
    "closer to 0 than 1e-200).",
    "no-overlap": "A correction has no sequence of the ground truth that it is to correct.",
    "bad-digest": "The content of a saved file does not match the digest stored in it.",
    "forbidden-pickle": "A pickle asks for something other than plain containers, numbers and arrays.",
    "bad-annotations": "An annotation file is not structured like the toolkit's.",
}
"""The meaning of every problem of a file, by its code."""


@dataclass(frozen=True, slots=True)
class Problem:
    """One fault of a file.

    `code` is one of `PROBLEM_CODES`; `where` a JSON pointer (`/predictions/12`), a position (`line 3, column
    8`), a file name, or "".
    """

    code: str
    message: str
    where: str = ""

    def __str__(self) -> str:
        return f"{self.plain_where}: {self.message}" if self.where else self.message

    @property
    def plain_where(self) -> str:
        """`where` for people: of a JSON pointer, the name of the member."""
        return plain_pointer(self.where)


@dataclass(frozen=True, slots=True)
class FileWarning:
    """A probable mistake in a file that is scored nevertheless."""

    code: str
    message: str


WARNING_CODES: Final[dict[str, str]] = {
    "not-seconds": "Nearly all values lie beyond ±20 s: probably milliseconds.",
    "looks-like-ratios": "Nearly all values lie between 0.5 and 1.5: probably scale ratios without a unit.",
    "within-one-second": "Nearly all values lie within ±1: probably inverse times or probabilities.",
    "constant-values": "Half of the values or more are the same: probably a default value.",
    "infinite-values": "A quarter of the values or more are infinite: probably an overflow.",
    "inverse-times": "Values change as inverse times do: probably 1/τ, or logarithms of scale ratios.",
    "wrong-rate": "Values are a fixed factor too large or too small: probably a wrong rate, or areas.",
    "flipped-signs": "Values of one object rise while time passes: probably every sign is wrong.",
    "one-sign": "All values have one sign: probably the sign was lost.",
    "shuffled-values": "The predictions seem to be in another order than the sequences: probably wrong keys.",
    "unlike-truth": "The predictions do not match the true times, or have the opposite sign.",
    "unlike-recordings": "In some recordings the predictions do not match the true times: probably old keys.",
    "shifted-times": "All times are about half a second off: probably counted from another frame.",
    "other-numbering": "The toolkit numbers the sequences of a folder differently on this machine.",
}
"""The meaning of every warning, by its code."""


class Rejected(Exception):
    """The refusal of a faulty file: its `problems`, and `n_problems` with those that are not listed."""

    def __init__(self, problems: Iterable[Problem], *, n_problems: int | None = None) -> None:
        self.problems: tuple[Problem, ...] = tuple(problems)
        self.n_problems = len(self.problems) if n_problems is None else n_problems
        super().__init__(str(self))

    def __reduce__(self) -> tuple[object, ...]:
        # An exception is copied by its message; this one is made from its problems.
        return _restored, (self.problems, self.n_problems)

    def __str__(self) -> str:
        title = n_problems_in_words(self.n_problems, n_lines=len(self.problems))
        return "\n".join([f"{title}:", *(f"  {number}. {p}" for number, p in enumerate(self.problems, 1))])

    def as_dict(self) -> dict[str, object]:
        """Return `{"n_problems": …, "problems": [{"code", "message", "where"}, …]}`."""
        return {"n_problems": self.n_problems, "problems": [asdict(problem) for problem in self.problems]}

    @classmethod
    def from_dict(cls, given: Mapping[str, object]) -> Rejected:
        """Read what `as_dict` wrote in an untrusted process; raises `ValueError` for anything else."""
        n_problems, lines = given.get("n_problems"), given.get("problems")
        if type(n_problems) is not int or not 0 < n_problems <= _MAX_COUNTED:
            raise ValueError("it has no number of problems")
        if not isinstance(lines, list) or not 0 < len(lines) <= _MAX_LINES:
            raise ValueError(f"it has no list of 1 to {_MAX_LINES} problems")
        return cls(map(_problem, lines), n_problems=n_problems)

    def to_json(self) -> str:
        """Return `as_dict()` as JSON."""
        return json.dumps(self.as_dict(), ensure_ascii=False)


def _problem(given: object) -> Problem:
    texts = given if isinstance(given, dict) else {}
    if texts.keys() != _MAX_CHARS.keys():
        raise ValueError(f"a problem has other fields than {', '.join(_MAX_CHARS)}")
    for name, most in _MAX_CHARS.items():
        text = texts[name]
        if not isinstance(text, str) or len(text) > most:
            raise ValueError(f"the {name} of a problem is no text of at most {most:,} characters")
    if texts["code"] not in PROBLEM_CODES:
        raise ValueError("the code of a problem is none of ours")
    return Problem(**texts)


def _restored(problems: tuple[Problem, ...], n_problems: int) -> Rejected:
    return Rejected(problems, n_problems=n_problems)


@dataclass(slots=True)
class _Line:
    problem: Problem
    n_more: int = 0
    more: list[str] = field(default_factory=list)

    def add(self, where: str) -> None:
        if where == (self.more[-1] if self.more else self.problem.where):
            return
        self.n_more += 1
        if len(self.more) <= MAX_LISTED:
            self.more.append(where)

    def merged(self) -> Problem:
        if not self.n_more:
            return self.problem
        # One name more than are shown says that there are more.
        further = "1 more place has" if self.n_more == 1 else f"{self.n_more:,} more places have"
        message = (
            f"{self.problem.message} {further} this problem: {listed([*map(plain_pointer, self.more)])}."
        )
        return Problem(self.problem.code, message, self.problem.where)


class Findings:
    """A collector of problems while a file is read: one answer names them all."""

    def __init__(self) -> None:
        self._lines: list[_Line] = []
        self._line_of: dict[tuple[str, str], _Line] = {}
        self._counts: Counter[str] = Counter()
        self._n_lines: Counter[str] = Counter()
        self._n_unlisted: Counter[str] = Counter()
        self._n_grouped = 0

    def add(self, code: str, message: str, where: str = "") -> None:
        """Note one fault; equal messages share a line, and at most `MAX_LISTED` lines of a kind are kept."""
        self._counts[code] += 1
        line = self._line_of.get((code, message)) if where else None
        if line:
            line.add(where)
        elif self._n_lines[code] < MAX_LISTED:
            self._n_lines[code] += 1
            line = _Line(Problem(code, message, where))
            self._lines.append(line)
            self._line_of[code, message] = line
        else:
            self._n_unlisted[code] += 1

    def group(self, code: str, message: str, where: str = "", *, n_faults: int) -> None:
        """Note many faults of one kind as one problem with count and examples."""
        self._lines.append(_Line(Problem(code, message, where)))
        self._n_grouped += n_faults

    def raise_if_any(self) -> None:
        if not self._lines:
            return
        rest = [
            Problem(code, f"And {self._n_unlisted[code]:,} more like these: {count:,} in all.")
            for code, count in self._counts.items()
            if self._n_unlisted[code]
        ]
        n_problems = self._counts.total() + self._n_grouped
        raise Rejected([*(line.merged() for line in self._lines), *rest], n_problems=n_problems)


def n_problems_in_words(n_problems: int, *, n_lines: int) -> str:
    count = counted(n_problems, "problem")
    return f"{count}; equal ones share a line" if n_lines < n_problems else count


def reject(code: str, message: str, where: str = "") -> Rejected:
    return Rejected([Problem(code, message, where)])


def quoted(text: str) -> str:
    """Quote `text` for a message: printable ASCII, shortened.

    >>> print(quoted("a\\x00\\ud800b"))
    "a\\u0000\\ud800b"
    """
    shown = json.dumps(text[:_MAX_QUOTED])
    return shown if len(text) <= _MAX_QUOTED else f'{shown[:-1]}…"'


def pointer(*parts: str) -> str:
    """Return the JSON pointer (RFC 6901) to the member named by `parts`, in printable ASCII.

    >>> pointer("predictions", "0007/1/500/3")
    '/predictions/0007~11~1500~13'
    """
    escaped = (part[:200].replace("~", "~0").replace("/", "~1") for part in parts)
    return "".join("/" + json.dumps(part)[1:-1] for part in escaped)


def plain_pointer(where: str) -> str:
    """Return a JSON pointer as people read it, other places as they are.

    >>> plain_pointer("/predictions/0007~11~1500~13"), plain_pointer("/fps/12"), plain_pointer("line 3")
    ('"0007/1/500/3"', '"12" in "fps"', 'line 3')
    """
    if not where.startswith("/"):
        return where
    parts = [part.replace("~1", "/").replace("~0", "~") for part in where[1:].split("/")]
    if len(parts) > 1 and parts[0] == "predictions":
        parts = parts[1:]
    return " in ".join(f'"{part}"' for part in reversed(parts))


def listed(names: Sequence[str]) -> str:
    """Join the first `MAX_LISTED` names."""
    text = ", ".join(names[:MAX_LISTED])
    return text if len(names) <= MAX_LISTED else f"{text}, … (the first {MAX_LISTED})"
