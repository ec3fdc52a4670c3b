"""Simulate whether confidence intervals, tests, rank ranges and verdicts hold: `python -m tests.validity`.

Errors of made-up methods on made-up recordings, where the truth is known: the models of `tests.error_models`.
Each repetition draws everything again. The suite runs few repetitions; the command many, and prints the
numbers of `docs/validation.md`.
"""

from collections.abc import Iterator

# Repetitions are columns, as score names are elsewhere; this number of them fits into memory.
CHUNK = 100


def chunks(n: int) -> Iterator[int]:
    """How many repetitions to draw at a time."""
    for start in range(0, n, CHUNK):
        yield min(CHUNK, n - start)


def margin(share: float, n: int) -> float:
    """The half width of a 95% confidence interval of a simulated share."""
    return 1.96 * float(max(share * (1 - share), 1e-9) / n) ** 0.5


def percent(share: float, n: int, *, decimals: int = 1) -> str:
    """A simulated share with its margin."""
    if not n:
        return "–"
    return f"{100 * share:.{decimals}f} ± {100 * margin(share, n):.{decimals}f}"
