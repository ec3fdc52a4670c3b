"""What a submission's team is told of how its scoring ended, in a sentence."""

from leaderboard import lifecycle
from leaderboard.models import Evaluation, Status


def sentence_of(evaluation: Evaluation) -> str:
    """Whose fault it was, or what goes on, where that needs saying."""
    n_failed = evaluation.n_poison_strikes + evaluation.n_infrastructure_strikes
    match evaluation.status:
        case Status.REJECTED if evaluation.kept_in is not None:
            return (
                f"Edition {evaluation.edition.number} cannot score this file. It keeps its result in edition "
                f"{evaluation.kept_in}, and its slot of the quota is given back."
            )
        case Status.REJECTED:
            n = evaluation.n_problems
            found = f"it has {n:,} problems" if n != 1 else "it has a problem"
            return f"The file is at fault: {found}, so nothing of it was scored."
        case Status.SYSTEM_ERROR:
            tries = f"{n_failed} times" if n_failed != 1 else "once"
            is_poison = evaluation.n_poison_strikes >= lifecycle.MAX_POISON_STRIKES
            counts = " Until then it counts among the files rejected within 24 hours." if is_poison else ""
            return (
                f"The fault is ours, not the file's: scoring it failed {tries}. The file is kept; the "
                f"maintainers see it and can have it scored again.{counts}"
            )
        case Status.CANCELLED:
            return "Its team cancelled it before it was scored."
        case Status.QUEUED | Status.RUNNING if n_failed:
            tries = f"{n_failed} tries" if n_failed != 1 else "One try"
            return (
                f"{tries} ended without a result. That says nothing of the file; it is tried again by itself."
            )
    return ""
