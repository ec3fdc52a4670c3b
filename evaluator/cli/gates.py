"""Gates: conditions on published scores, `NAME OPERATOR NUMBER` joined by `or`, that set the exit code."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, TypeVar

import click

from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure, echo_json
from evaluator.cli.layout import printable, short_name
from evaluator.metrics.protocol import known_names, metric_of, primary_of, primary_value

if TYPE_CHECKING:
    from evaluator.client.answers import Board, BoardEntry
    from evaluator.client.api import Client

OPERATORS: Final[dict[str, Callable[[float, float], bool]]] = {
    ">=": operator.ge,
    "<=": operator.le,
    "==": operator.eq,
    "!=": operator.ne,
    ">": operator.gt,
    "<": operator.lt,
}
_CONDITION: Final = re.compile(
    r"\s*(?P<name>[A-Za-z0-9_]+)\s*(?P<operator>>=|<=|==|!=|>|<)\s*(?P<number>[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d+)?)\s*",
    re.ASCII,
)
_OR: Final = re.compile(r"\bor\b", re.ASCII)

Command = TypeVar("Command", bound=Callable[..., Any])
Scores = Mapping[str, float | None]


@dataclass(frozen=True, slots=True)
class Condition:
    name: str
    operator: str
    number: float

    def __str__(self) -> str:
        return f"{self.name} {self.operator} {self.number:g}"

    def holds(self, scores: Scores) -> bool | None:
        """Whether the condition holds; None if there is no such value."""
        value = scores.get(self.name)
        return None if value is None else OPERATORS[self.operator](round(value, 2), self.number)


def parse(text: str) -> list[Condition]:
    """Parse alternative conditions; raises `ValueError` that says what was expected where.

    >>> [str(condition) for condition in parse("MiD > 15 or RTE_n > 7")]
    ['mid > 15', 'rte_negative > 7']
    >>> parse("mid")
    Traceback (most recent call last):
    ValueError: found 'mid', expected NAME OPERATOR NUMBER, such as mid > 15.0
    """
    return [_condition(part) for part in _OR.split(text)]


def _condition(text: str) -> Condition:
    match = _CONDITION.fullmatch(text)
    if match is None:
        shown = text.strip() or "nothing"
        joined = "; several are joined by or" if " and " in text else ""
        raise ValueError(f"found {shown!r}, expected NAME OPERATOR NUMBER, such as mid > 15.0{joined}")
    # As tables write them, too: MiD, MiD_c. Of two protocols with one spelling, the first keeps it.
    spellings = [(name, name) for name in known_names()]
    called: dict[str, str] = {}
    for spelt, meant in (*spellings, *((short_name(name), name) for name in known_names())):
        called.setdefault(spelt.lower(), meant)
    name = called.get(match["name"].lower())
    if name is None:
        raise ValueError(f"found {match['name']!r}, expected one of {', '.join(known_names())}")
    return Condition(name, match["operator"], float(match["number"]))


def fail_if_option(command: Command) -> Command:
    return click.option(
        "--fail-if",
        "fail_if",
        multiple=True,
        metavar="CONDITION",
        callback=_conditions,
        help='Exit with code 6 if the condition is true, such as "mid > 15.0 or rte > 20"; may be repeated.',
    )(command)


def _conditions(
    _context: click.Context, _parameter: click.Parameter, texts: Sequence[str]
) -> list[Condition]:
    try:
        return [condition for text in texts for condition in parse(text)]
    except ValueError as fault:
        raise click.BadParameter(f"{fault}.") from None


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a gate says of a result: whether it fails (None: a value is missing), and why."""

    gate: str
    is_failing: bool | None
    reason: str


def verdicts_of(
    conditions: Sequence[Condition], scores: Scores | None, *, decimals: int = 2
) -> list[Verdict]:
    """What each condition says of these scores."""
    known: Scores = scores or {}
    verdicts = []
    for condition in conditions:
        is_failing, value = condition.holds(known), known.get(condition.name)
        reason = f"there is no value for {condition.name}"
        if value is not None:
            matches = f", which matches {condition}" if is_failing else ""
            reason = f"{condition.name} is {value:.{decimals}f}{matches}"
        verdicts.append(Verdict(f"--fail-if {condition}", is_failing, reason))
    return verdicts


def judge(verdicts: Sequence[Verdict]) -> None:
    """Raise Failure with every gate that fails, or has no value."""
    failing = [verdict.reason for verdict in verdicts if verdict.is_failing]
    missing = dict.fromkeys(verdict.reason for verdict in verdicts if verdict.is_failing is None)
    if failing:
        words = f"The gate fails: {'; '.join([*failing, *missing])}."
        raise Failure(words, exit_code=Exit.GATE, code="gate-failed")
    if missing:
        raise undecided("; ".join(missing))


def show_and_judge(
    document: Mapping[str, Any], *, show: Callable[[], None], judge: Callable[[], None], as_json: bool
) -> None:
    """Show a result and raise what `judge` raises; as JSON, one document has both."""
    failure = None
    try:
        judge()
    except Failure as raised:
        failure = raised
    if as_json and failure is None:
        echo_json(document)
    elif not as_json:
        show()
    if failure is not None:
        failure.document = {**document, "gate": failure.document}
        raise failure


def undecided(why: str) -> Failure:
    return Failure(f"The gate cannot be evaluated: {why}.", exit_code=Exit.GATE, code="gate-undecided")


# --- worse than another method ---------------------------------------------------------------------------


def named(board: Board, name: str) -> BoardEntry:
    """Find a method's row by id or name; raises Failure unless there is exactly one."""
    # A quoted row wins over a method of the same name: only teams can change names.
    rows = rows_named(board, name)
    if len(rows) == 1:
        return rows[0]
    if not rows:
        raise Failure(
            f"The board of {board.split} has no method {printable(name)!r}; expected a name or an id that is "
            "on it.",
            exit_code=Exit.USAGE,
            code="unknown-method",
            hint=f"List them with: tsttc board {board.split}",
        )
    ids = ", ".join(f"{entry.id or entry.method_id} ({printable(entry.team or '')})" for entry in rows)
    raise Failure(
        f"The board of {board.split} has {len(rows)} methods called {printable(name)!r}: {ids}; "
        "expected an id.",
        exit_code=Exit.USAGE,
        code="ambiguous-method",
    )


def rows_named(board: Board, name: str) -> list[BoardEntry]:
    """Return the rows with this id, else the quoted rows, else all rows of this name."""
    by_id = [entry for entry in board.entries if name in {entry.id, entry.method_id}]
    by_name = [entry for entry in board.entries if name == entry.method]
    return by_id or [entry for entry in by_name if entry.kind == "published"] or by_name


def rival(client: Client, *, split: str, method: str, own: str) -> BoardEntry | None:
    """Return the other method's row, None for `own` before it has one; raises Failure."""
    board = client.board(split)
    if method == own and not rows_named(board, method):
        words = f"{printable(method)} is not on the board of {split} yet; nothing to compare with."
        click.echo(words, err=True)
        return None
    entry = named(board, method)
    if primary_value(entry.scores) is None:
        symbol = metric_of(primary_of(entry.scores)).symbol
        raise undecided(f"{printable(entry.method)} has no {symbol} on {split}")
    return entry


def verdict_against(entry: BoardEntry, *, scores: Scores | None, decimals: int = 2) -> Verdict:
    """Judge whether the score that ranks is worse than the other method's."""
    name, primary, other = printable(entry.method), primary_of(entry.scores), primary_value(entry.scores)
    gate, value = f"--fail-if-worse-than {name}", (scores or {}).get(primary)
    if value is None or other is None:
        return Verdict(gate, None, f"there is no value for {primary}")
    symbol = metric_of(primary).symbol
    reason = f"{symbol} is {value:.{decimals}f}, and {name} has {other:.{entry.decimals}f}"
    return Verdict(gate, value > other, reason)
