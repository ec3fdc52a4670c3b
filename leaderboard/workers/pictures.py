"""Drawing the cards of boards and methods, once for each change that everybody sees."""

from collections.abc import Callable
from datetime import datetime

from leaderboard.exports import card_drawing, cards


def draw(*, now: datetime, is_stopping: Callable[[], bool] = lambda: False) -> int:
    """Draw the cards that are missing, and remove those that no longer hold. Returns how many were drawn."""
    present = cards.present()
    cards.remove_others(present)
    n_drawn = 0
    for card in cards.missing(present.values()):
        if is_stopping():
            break
        cards.keep(card, card_drawing.png(card), now=now)
        n_drawn += 1
    return n_drawn
