"""Sentences about the end of scoring; this module computes nothing."""

from evaluator.counting import counted
from leaderboard.models import Evaluation, Status
from leaderboard.queue import lifecycle


def sentence_of(evaluation: Evaluation) -> str:
    """Word the cause of a failure or delay, or what happens now; else empty."""
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
            return _of_system_error(evaluation, n_failed=n_failed)
        case Status.CANCELLED:
            return "The team cancelled the submission before it was scored."
        case Status.QUEUED | Status.RUNNING if n_failed:
            tries = f"{n_failed} tries" if n_failed != 1 else "One try"
            return f"{tries} ended without a result; the file may be fine. We retry automatically."
    return ""


def short_fault(message: str) -> str:
    """Return the fault alone of a problem's message, without its places and what was expected.

    >>> short_fault('1 key is not in the manifest: "zz"; expected its anno_ids.')
    '1 key is not in the manifest'
    """
    return message.partition("; expected")[0].partition(": ")[0]


def _of_system_error(evaluation: Evaluation, *, n_failed: int) -> str:
    counts = " Until then it counts as a rejected file for 24 hours." if evaluation.is_file_suspect else ""
    if evaluation.is_file_suspect and evaluation.n_poison_strikes < lifecycle.MAX_POISON_STRIKES:
        # Given up before its strikes were exhausted.
        return (
            "Reading the file took more processor time than a file for this split may take, so it was not "
            "scored; `tsttc check` reads it on your machine without this limit. We keep the file, and a "
            f"maintainer can have it read again.{counts}"
        )
    tries = f"{n_failed} times" if n_failed != 1 else "once"
    return (
        f"Scoring failed {tries} because of a system error; the file is not at fault. We keep "
        f"the file, and a maintainer can retry it.{counts}"
    )
