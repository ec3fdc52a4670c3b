"""What the pages of a method say of who sees it."""

from typing import NamedTuple

from django.utils.html import format_html
from django.utils.safestring import SafeString

from leaderboard.boards.visibility_preview import BoardPreview
from leaderboard.models import Method, Visibility
from leaderboard.web.formatting import grouped, moment

_PUBLIC = "Everyone sees its name, your team’s name, its description, paper, code and details."


class Words(NamedTuple):
    """The sentences above a choice of visibility; `hidden` is the offer to be or to stay anonymous."""

    title: str
    lead: str | SafeString
    legend: str = ""
    hidden_label: str = ""
    hidden: str = ""
    public: str = _PUBLIC


def words(method: Method) -> Words:
    """Word the choices that a method has left; a public one has none."""
    if method.visibility == Visibility.PRIVATE:
        return Words(
            title=f"Publish “{method.name}”",
            lead="Only your team and the maintainers see this method. "
            "Once published, even anonymously, it cannot become private again.",
            legend="Publish it",
            hidden_label="Anonymously",
            hidden=f"Everyone sees its scores as “{method.pseudonym}” of team “Anonymous”. Its description, "
            "links, pretraining and hardware stay hidden. For papers under double-blind review.",
        )
    if method.visibility == Visibility.ANONYMOUS:
        return Words(
            title=f"Make “{method.name}” public",
            lead=format_html(
                "At present, everyone sees its scores as “{}”{}. "
                "Once public, it cannot become anonymous again.",
                method.pseudonym,
                format_html(", until {}", moment(method.reveal_at)) if method.reveal_at else "",
            ),
            legend="Make it public",
            hidden_label="Later",
            hidden="It stays anonymous until the date you choose.",
        )
    return Words(
        title=f"“{method.name}” is public",
        lead="Everyone sees the method. It cannot become anonymous or private again.",
    )


def button(present: str, *, wanted: str) -> str:
    """Name the step from one visibility to another; an anonymous method that stays so changes its day."""
    if present == wanted:
        return "Save the day"
    if present == Visibility.ANONYMOUS:
        return "Make public"
    return "Publish anonymously" if wanted == Visibility.ANONYMOUS else "Publish"


def seen_by(visibility: str, *, is_named: bool, is_mine: bool) -> str:
    """Say to a method's team who sees its page; empty for others.

    `is_named` tells whether the reader sees the name of an anonymous method.
    """
    if visibility == Visibility.PRIVATE:
        return "only your team and the maintainers can see this page"
    if visibility == Visibility.PUBLIC and is_mine:
        return "public"
    if visibility == Visibility.ANONYMOUS and is_named:
        return "other teams see neither its name nor your team"
    return ""


def standing(board: BoardPreview) -> str:
    """Say where a row would stand on a board."""
    rank = f"rank {board.entry.rank} of {board.n_ranked}, " if board.entry.rank else ""
    return f"{rank}edition {board.edition.number}, dated {board.entry.date_text}"


def attempts(board: BoardPreview, *, wanted: str) -> str:
    """Say how many attempts a row would show, and what these count."""
    if wanted != Visibility.PUBLIC:
        counted = "this method’s scored submissions"
    else:
        counted = "the scored submissions of all your public methods to this split"
        if board.n_attempts_now is not None:
            counted += (
                f"; your other public rows, which show {grouped(board.n_attempts_now)}, "
                "change to the same number"
            )
    return f"Attempts shown: {grouped(board.entry.n_attempts)} ({counted})."
