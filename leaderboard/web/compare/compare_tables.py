"""Tables of comparisons: the verdict in words, the values, the differences of each pair."""

from collections.abc import Mapping, Sequence
from typing import Any, Final
from uuid import UUID

from django.utils.text import get_text_list

from evaluator import Difference
from evaluator.metrics.protocol import grouped_names, metric_of
from evaluator.scoring.results import format_rounded
from evaluator.tables import sentences
from evaluator.tables.sentences import p_cell
from evaluator.units import RECORDING, in_words
from leaderboard.boards.rows import Entry
from leaderboard.models import Edition
from leaderboard.statistics.comparisons import Compared, Pair
from leaderboard.web.boards.score_columns import Group, score_groups, score_heading
from leaderboard.web.charts import profile_chart, svg
from leaderboard.web.compare.difference_matrix import (
    best_entry,
    difference_matrix,
    findings,
    interval_of,
    tested_pairs,
)
from leaderboard.web.formatting import signed, with_bold_names

_NUMBERS: Final = {2: "two", 3: "three", 4: "four", 5: "five"}


def comparison(compared: Compared, *, n_tried: Mapping[UUID, int]) -> dict[str, Any]:
    """Return a comparison for the page; `n_tried` are scored submissions by method."""
    names = [entry.method for entry in compared.entries]
    chosen = sentences.selection(
        {each.method: n_tried.get(each.method_id, 0) for each in compared.entries if each.method_id}
    )
    matrix = difference_matrix(compared)
    pairs = [_pair_table(pair) for pair in compared.pairs]
    return {
        "compared": compared,
        "title": f"{_NUMBERS[len(names)].capitalize()} methods compared",
        "verdict": with_bold_names(verdict(compared), names),
        "matrix": matrix,
        "metric": metric_of(compared.entries[0].primary),
        "description": "Differences of methods in each TTC range, and whether they are significant.",
        "pairs": pairs,
        "only_pair": pairs[0] if len(pairs) == 1 else None,
        "how_tested": how_tested(compared.edition, is_hidden=compared.split.is_hidden),
        "profile": profile_chart.profile(compared.entries),
        "selection": with_bold_names(chosen, names),
    }


def how_tested(edition: Edition, *, is_hidden: bool) -> str:
    """Say what the test of a difference takes as independent, and what it can miss."""
    noun = edition.unit_noun
    alike = "sequences from one recording" if edition.unit == RECORDING else f"recordings from one {noun}"
    told = [
        f"A two-sided sign-flip test of whole {noun}s ({edition.units}), "
        f"because {alike} resemble each other.",
        "It gives the 95% CI and p, and can miss rare but severe failures.",
    ]
    if is_hidden:
        told.append(
            "The ground truth is hidden, so the ends of the intervals are rounded outwards: "
            "0 may be an end although p is below 0.05."
        )
    return " ".join(told)


def verdict(compared: Compared) -> str:
    """Word the outcome: of two a sentence; of more the best, and which are significantly worse."""
    if not compared.is_complete:
        return ""
    if len(compared.entries) == len(("first", "second")):
        return compared.pairs[0].sentence()
    best = best_entry(compared.entries)
    of_best = [pair for pair in tested_pairs(compared) if best in (pair.first, pair.second)]
    sorted_out = findings(compared)
    worse, here_alone = (_rivals(best, [pair for pair in of_best if pair in some]) for some in sorted_out)
    alike = _rivals(best, [pair for pair in of_best if not any(pair in some for some in sorted_out)])
    head = (
        f"Of these {_NUMBERS[len(compared.entries)]}, {best.method} has the lowest "
        f"{metric_of(best.primary).symbol}, "
        f"{format_rounded(best.value, decimals=best.decimals)}."
    )
    if compared.reason:
        few = in_words(compared.edition.unit)
        return f"{head} There are too few {few} for confidence intervals and p-values."
    relations = (("significantly better than", worse), ("not significantly better than", alike))
    all_others = len(compared.entries) - 1
    parts = [
        f"{relation} the other {_NUMBERS[all_others]}"
        if len(names) == all_others
        else f"{relation} {get_text_list(names, 'and')}"
        for relation, names in relations
        if names
    ]
    lines = [head]
    if parts:
        lines.append(f"It is {', and '.join(parts)}{_together(compared)}.")
    if here_alone:
        names, together = get_text_list(here_alone, "and"), "" if parts else _together(compared)
        lines.append(
            f"Among these {_NUMBERS[len(compared.entries)]}, it is significantly better than {names}"
            f"{together}; among all pairs of the board it is not, and {names} may be the best."
        )
    return " ".join([*lines, *dict.fromkeys(pair.withheld for pair in compared.pairs if pair.withheld)])


def _together(compared: Compared) -> str:
    n_tested = len(tested_pairs(compared))
    return f" (corrected for all {n_tested} pairs)" if n_tested > 1 else ""


def _rivals(best: Entry, pairs: Sequence[Pair]) -> list[str]:
    return [(pair.second if pair.first == best else pair.first).method for pair in pairs]


def _pair_table(pair: Pair) -> dict[str, Any]:
    differences = pair.differences or {}
    columns = pair.first.scores
    names = (pair.first.method, pair.second.method)
    return {
        "pair": pair,
        "sentence": with_bold_names(pair.sentence(), names),
        "others": pair.others(),
        "influence": with_bold_names(pair.influence(), names),
        "groups": [
            _difference_group(group, [name for name in names if name in differences], pair, differences)
            for group, names in zip(score_groups(columns), grouped_names(columns).values(), strict=True)
        ]
        if differences
        else [],
        "has_intervals": any(difference.low is not None for difference in differences.values()),
    }


def _difference_group(
    group: Group, names: Sequence[str], pair: Pair, differences: Mapping[str, Difference]
) -> dict[str, Any]:
    of_group = [differences[name] for name in names]
    ends = [end for each in of_group for end in (each.low, each.high, each.difference) if end is not None]
    scale_end = svg.scale_end(ends)
    rows = [_difference_row(name, pair, differences[name], scale_end) for name in names]
    return {"group": group, "axis": svg.axis(scale_end), "rows": rows}


def _difference_row(name: str, pair: Pair, difference: Difference, scale_end: float) -> dict[str, Any]:
    decimals = pair.first.decimals  # both are of one edition
    return {
        "heading": score_heading(name, primary=pair.first.primary),
        "first": format_rounded(pair.first.scores[name], decimals=decimals),
        "second": format_rounded(pair.second.scores[name], decimals=decimals),
        "difference": signed(difference.difference, decimals=decimals),
        "interval": interval_of(difference, decimals=decimals),
        "p": p_cell(difference.p, difference.p_below),
        # why there is neither interval nor p
        "reason": difference.why_untested,
        "is_significant": difference.is_significant,
        "drawn": svg.difference(scale_end, difference.difference, difference.low, difference.high),
    }
