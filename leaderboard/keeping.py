"""How a view says that anybody may be answered from memory (see `leaderboard/web/kept.py`)."""

from collections.abc import Callable
from functools import wraps
from typing import Any, Final, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
_MARK: Final = "is_kept"


def kept(view: Callable[P, R]) -> Callable[P, R]:
    """What this view answers anybody depends on its address and on what the boards' numbers count alone."""

    @wraps(view)
    def marked(*args: P.args, **kwargs: P.kwargs) -> R:
        response = view(*args, **kwargs)
        setattr(response, _MARK, True)
        return response

    return marked


def is_kept(response: Any) -> bool:
    """Whether the view that made it says so."""
    return getattr(response, _MARK, False) is True
