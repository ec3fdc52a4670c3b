"""Sentences about the end of scoring; pages ask for them, so this module computes nothing."""

from evaluator.counting import counted
from evaluator.scoring.significance import MIN_DEGREES, too_few_units
from leaderboard.models import Edition, Evaluation, Status
from leaderboard.scoring import lifecycle


def sentence_of(evaluation: Evaluation) -> str:
    """Whose fault it was, or what goes on, where that needs saying."""
    n_failed = evaluation.n_poison_strikes + evaluation.n_infrastructure_strikes
    match evaluation.status:
        case Status.REJECTED if evaluation.kept_in is not None:
            return (
                f"Edition {evaluation.edition.number} cannot score this file. It keeps its result in edition "
                f"{evaluation.kept_in}, and your quota is refunded."
            )
        case Status.REJECTED:
            n = evaluation.n_problems
            return f"The file is at fault: it has {counted(n, 'problem')}, so it was not scored."
        case Status.SYSTEM_ERROR:
            tries = f"{n_failed} times" if n_failed != 1 else "once"
            is_poison = evaluation.n_poison_strikes >= lifecycle.MAX_POISON_STRIKES
            counts = " Until then it counts as a rejected file for 24 hours." if is_poison else ""
            return (
                f"Scoring failed {tries} because of a system error; the file is not at fault. We keep "
                f"the file, and a maintainer can retry it.{counts}"
            )
        case Status.CANCELLED:
            return "The team cancelled the submission before it was scored."
        case Status.QUEUED | Status.RUNNING if n_failed:
            tries = f"{n_failed} tries" if n_failed != 1 else "One try"
            return f"{tries} ended without a result; the file may be fine. We retry automatically."
    return ""


def why_no_interval(edition: Edition) -> str:
    """Why nothing in this edition has an interval, a rank range or a p-value; "" where some have.

    A worker finds out how many units an edition effectively has, and writes it beside the edition; until
    then only an edition with too few units in all is known to have none.
    """
    most = max(edition.n_effective.values(), default=float(edition.unit_count))
    if most >= MIN_DEGREES:
        return ""
    return f"There are no confidence intervals: {too_few_units(most, unit=edition.unit)}."
