"""What publishing an edition does to the board: in sentences, and entry by entry."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

from django.core.paginator import Paginator
from django.utils.text import get_text_list

from evaluator import units
from evaluator.counting import counted
from evaluator.metrics.protocol import metric_of, range_of
from evaluator.metrics.registry import Metric
from evaluator.scoring.results import format_rounded
from leaderboard.editions.preview import ABSENT, Change, Preview
from leaderboard.models import Status
from leaderboard.web.boards import edition_tables
from leaderboard.web.boards.score_columns import column_css, score_heading

PER_PAGE: Final = 50
MOVED: Final = "moved"
_ENDED_BADLY: Final = (Status.REJECTED, Status.SYSTEM_ERROR, Status.CANCELLED)
STATUS_LABELS: Final = {**dict(Status.choices), ABSENT: "not evaluated"}


def change_table(preview: Preview, *, rows: str | None = None, number: str | None = None) -> dict[str, Any]:
    """Return a page of the preview for the template; with `rows` "moved", only entries with another rank."""
    primary, names = preview.edition.rules.primary.name, _shown_names(preview)
    ranks = [entry.new_rank for entry in preview.entries if entry.new_rank is not None]
    moved = tuple(entry for entry in preview.entries if entry.rank_change > 0)
    page = Paginator(moved if rows == MOVED else preview.entries, PER_PAGE).get_page(number)
    return {
        "page": page,
        "is_moved_only": rows == MOVED,
        "n_entries": len(preview.entries),
        "n_moved": len(moved),
        "headings": [score_heading(name, primary=primary) for name in names],
        "rows": [_change_row(change, names, preview) for change in page],
        "has_states": any({e.old_status, e.new_status} != {Status.SCORED} for e in preview.entries),
        "has_gaps": len(ranks) < max(ranks, default=0),
        "has_unranked": any(None in (e.old_rank, e.new_rank) for e in preview.entries),
        "n_rejected_in_both": len(preview.changes) - len(preview.entries),
    }


def newly_rejected(preview: Preview) -> list[Change]:
    """Return the entries that the published edition scores and this one rejects."""
    return [
        entry
        for entry in preview.entries
        if (entry.old_status, entry.new_status) == (Status.SCORED, Status.REJECTED)
    ]


def effects(preview: Preview) -> tuple[str, ...]:
    """Word what the edition does to the board; what stays the same comes last."""
    kept = [metric for metric in preview.edition.rules.metrics if metric in preview.published.rules.metrics]
    by_count = defaultdict(list)
    for metric in kept:
        by_count[sum(_is_rescored(change, metric) for change in preview.entries)].append(metric.symbol)
    unchanged = by_count.pop(0, [])
    n_moved = sum(None not in (e.old_rank, e.new_rank) and e.rank_change > 0 for e in preview.entries)
    if not any(_is_scored_in_both(change) for change in preview.entries):
        unchanged = []
    elif not n_moved:
        unchanged.append("all other ranks" if preview.n_moved else "all ranks")
    before = [entry.old_status for entry in preview.entries]
    truth = _truth_effect(preview)
    unchanged += ["the ground truth"] * (not truth)
    is_one = len(unchanged) == 1 and not unchanged[0].startswith("all ")
    scores = (
        f"{get_text_list(symbols, 'and')} change{'s' * (len(symbols) == 1)} for {_share(n, before)}."
        for n, symbols in by_count.items()
    )
    sentences = (
        truth,
        *_rule_effects(preview),
        *_state_effects(preview),
        *scores,
        f"{_share(n_moved, before)} get{'s' * (n_moved == 1)} another rank." if n_moved else "",
        f"{get_text_list(unchanged, 'and')} stay{'s' * is_one} the same." if unchanged else "",
    )
    return tuple(sentence[0].upper() + sentence[1:] for sentence in sentences if sentence)


def _truth_effect(preview: Preview) -> str:
    """Word the change of the ground truth; empty for none."""
    if preview.truth is None:
        return "The ground truth is different. A worker counts the differences within a minute."
    words = edition_tables.truth_words(preview.truth)
    if preview.truth.n_renumbered is None:
        words = f"{words}; changes of anno_id were not counted".removeprefix("; ")
    return f"Ground truth: {words}." if words else ""


def _rule_effects(preview: Preview) -> Iterator[str]:
    """Word changes of the protocol, of the decimals and of the unit."""
    old, new = preview.published, preview.edition
    if old.protocol != new.protocol:
        change = f"The protocol changes from {old.protocol} to {new.protocol}."
        yield " ".join((change, *_protocol_effects(preview)))
    if old.decimals != new.decimals:
        yield f"Scores have {counted(new.decimals, 'decimal')} instead of {old.decimals}."
    if old.unit != new.unit:
        old_units, new_units = units.in_words(old.unit), units.in_words(new.unit)
        yield f"Confidence intervals and rank ranges are computed from {new_units} instead of {old_units}."


def _protocol_effects(preview: Preview) -> Iterator[str]:
    """Word which scores come and go with the protocol, and which one ranks from now on."""
    old, new, entries = preview.published.rules, preview.edition.rules, preview.entries
    for metric in old.metrics:
        if metric not in new.metrics:
            n = sum(_has(e.old, metric) and e.new_status == Status.SCORED for e in entries)
            share = _share(n, (e.old_status for e in entries))
            loss = f": {share} lose{'s' * (n == 1)} this score" if n else ""
            yield f"The new one does not compute the {_title(metric)}{loss}."
    for metric in new.metrics:
        if metric not in old.metrics:
            n = sum(_has(e.new, metric) for e in entries)
            share = _share(n, (e.new_status for e in entries))
            gain = f": {share} get{'s' * (n == 1)} this score" if n else ""
            yield f"The new one adds the {_title(metric)}{gain}."
    for one, other, verb in ((old, new, "has no"), (new, old, "adds the")):
        gone = (each for each in one.ranges if each not in other.ranges)
        yield from (f"The new one {verb} TTC range {each.name} ({each.seconds})." for each in gone)
    if old.primary != new.primary:
        yield f"{new.primary.symbol} ranks the board instead of {old.primary.symbol}."


def _state_effects(preview: Preview) -> Iterator[str]:
    """Word how many entries lose all of their scores, or get their first."""
    if n := preview.n_newly_rejected:
        yield f"{counted(n, 'scored submission')} become{'s' * (n == 1)} rejected."
    n = sum(Status.SCORED == e.new_status != e.old_status for e in preview.entries)
    if n:
        yield f"{counted(n, 'more submission')} {'is' if n == 1 else 'are'} scored."
    absent = [e.old_status == Status.SCORED for e in preview.entries if e.new_status == ABSENT]
    for n, one, more in (
        (absent.count(True), "scored submission is", "scored submissions are"),
        (absent.count(False), "submission without a score is", "submissions without a score are"),
    ):
        if n:
            yield f"{counted(n, one, more)} not evaluated in this edition."


def _share(n: int, statuses: Iterable[str]) -> str:
    """Word how many of the scored submissions these are; `statuses` are those of all entries."""
    n_scored = sum(status == Status.SCORED for status in statuses)
    scored = counted(n_scored, "scored submission")
    if n < n_scored:
        return f"{n:,} of {scored}"
    return scored if n == 1 else f"all {scored}"


def _title(metric: Metric) -> str:
    """Name a metric inside a sentence, such as "warning error (WE)"."""
    return f"{metric.title[0].lower()}{metric.title[1:]} ({metric.symbol})"


def _is_scored_in_both(change: Change) -> bool:
    return change.old_status == change.new_status == Status.SCORED


def _has(scores: Mapping[str, float | None], metric: Metric) -> bool:
    return scores.get(metric.name) is not None


def _is_rescored(change: Change, metric: Metric) -> bool:
    """Tell whether a score that both editions give has another value."""
    names = (name for name in change.old if name in change.new and metric_of(name) == metric)
    return _is_scored_in_both(change) and any(change.old[name] != change.new[name] for name in names)


def _shown_names(preview: Preview) -> tuple[str, ...]:
    """Return the scores of the new protocol, and the overall ones that it drops."""
    kept = preview.edition.rules.score_names
    return tuple(name for name in preview.names if name in kept or range_of(name) is None)


def _change_row(change: Change, names: Sequence[str], preview: Preview) -> dict[str, Any]:
    old_status, new_status = (STATUS_LABELS[s] for s in (change.old_status, change.new_status))
    is_news = change.problems and change.old_status != change.new_status
    reason = change.problems[0]["message"] if is_news else ""
    summary = reason.partition(": ")[0]
    status = new_status if old_status == new_status else f"{new_status} (before: {old_status})"
    state = "" if status == STATUS_LABELS[Status.SCORED] else status
    return {
        "change": change,
        "has_changed": change.old_rank != change.new_rank,
        "status": status,
        "state": f"{state}: {summary}" if state and summary else state,
        "is_worse_off": change.old_status == Status.SCORED and change.new_status in _ENDED_BADLY,
        "differences": [_difference(name, change, preview) for name in names],
        "summary": summary,
        "reason": reason,  # why it is rejected now and was not
        "n_more_problems": max(0, len(change.problems) - 1),
    }


def _difference(name: str, change: Change, preview: Preview) -> dict[str, Any]:
    delta = change.delta[name]
    css = column_css(name, primary=preview.edition.rules.primary.name).replace("wide", "")
    old = format_rounded(change.old.get(name), decimals=change.old_decimals)
    new = format_rounded(change.new.get(name), decimals=change.new_decimals)
    is_dropped = name not in preview.edition.rules.score_names
    is_new = name not in preview.published.rules.score_names
    return {
        "was": "" if is_dropped or is_new or old == new else old,
        "now": old if is_dropped else new,
        "is_struck": is_dropped and change.old.get(name) is not None,
        "delta": delta_words(delta, decimals=max(change.old_decimals, change.new_decimals)),
        "css": css if delta else f"{css} same".strip(),
    }


def delta_words(delta: float | None, *, decimals: int = 2) -> str:
    """Format a difference with its sign.

    >>> delta_words(0.09), delta_words(-1.5), delta_words(0.0), delta_words(None)
    ('+0.09', '−1.50', '0.00', '')
    """
    if delta is None:
        return ""
    return f"{delta:+.{decimals}f}".replace("-", "−") if delta else f"{0:.{decimals}f}"
