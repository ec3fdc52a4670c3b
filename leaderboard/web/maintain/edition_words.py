"""What the maintainers' pages of an edition say in sentences of several branches."""

from evaluator.counting import counted
from leaderboard.editions.corrections import RescoringProgress
from leaderboard.models import Edition


def is_current(edition: Edition) -> bool:
    return edition.pk == edition.split.current_edition_id


def standing(edition: Edition) -> str:
    """Word what an edition is to its split, such as "current"."""
    if is_current(edition):
        return "current"
    if edition.is_draft:
        return "draft"
    if edition.discarded_at:
        return "discarded"
    return "former, opened again" if edition.reopened_at else "former"


def comparison_heading(edition: Edition) -> str:
    if is_current(edition):
        return "What this edition changed"
    return "What would change if it is published again" if edition.published_at else "What would change"


def why_not_published(edition: Edition) -> str:
    """Say why an edition cannot be published; empty if it can."""
    if edition.discarded_at:
        return f"Edition {edition.number} was discarded, so it cannot be published."
    if is_current(edition):
        return f"Edition {edition.number} is the current board already, so it cannot be published."
    return ""


def left_out(*, n_unfinished: int, n_rejected: int) -> str:
    """Count what a new board leaves out.

    >>> left_out(n_unfinished=1, n_rejected=2), left_out(n_unfinished=0, n_rejected=1)
    ('1 submission not finished, 2 scored submissions rejected', '1 scored submission rejected')
    """
    unfinished = f"{counted(n_unfinished, 'submission')} not finished" if n_unfinished else ""
    rejected = f"{counted(n_rejected, 'scored submission')} rejected" if n_rejected else ""
    return ", ".join(part for part in (unfinished, rejected) if part)


def discarding(edition: Edition, progress: RescoringProgress) -> str:
    """Say what discarding a draft does, or closing an edition that was opened again."""
    n_waiting, n_done = progress.n_waiting, progress.n_done
    if edition.reopened_at:
        waiting = counted(n_waiting, "queued evaluation is", "queued evaluations are")
        still = f"; {waiting} still scored" if n_waiting else ""
        return (
            f"Edition {edition.number} stays a former edition, with the scores that it has. New submissions "
            f"are no longer queued for it{still}. You can open or publish it again later."
        )
    lead = (
        "Nothing public changes. A discarded edition can never be published, but you can open a new draft "
        "with the same ground truth and protocol; it gets a new number."
    )
    if not n_waiting:
        return lead
    waiting = counted(n_waiting, "queued evaluation is", "queued evaluations are")
    done = counted(n_done, "finished evaluation stays", "finished evaluations stay")
    return f"{lead} {waiting} cancelled; {done}." if n_done else f"{lead} {waiting} cancelled."
