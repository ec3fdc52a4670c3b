"""Drawing the cards of boards and methods, once for each change that everybody sees."""

from collections.abc import Callable
from datetime import datetime

from leaderboard.exports import card_drawing, cards
from leaderboard.scoring import worker

PATIENCE_S = 0.1


def draw(*, now: datetime, is_stopping: Callable[[], bool] = lambda: False) -> int:
    """Draw the cards that are missing, and remove those that no longer hold. Returns how many were drawn.

    One more method changes the cards of all: it is told among how many each stands. So they wait while
    another thread of this process decides a submission.
    """
    present = cards.present()
    cards.remove_others(present)
    n_drawn = 0
    for card in cards.missing(present.values()):
        while not is_stopping() and worker.others_decide(timeout_s=PATIENCE_S):
            pass
        if is_stopping():
            break
        cards.keep(card, card_drawing.png(card), now=now)
        n_drawn += 1
    return n_drawn
