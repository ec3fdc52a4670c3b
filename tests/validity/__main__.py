"""Print the tables of `docs/validation.md`, or some by name: `python -m tests.validity coverage days`."""

import argparse
import itertools
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Final

import numpy as np

from tests import error_models
from tests.validity import coverage, detectable, fields, formulas, percent, rare, verdicts, worlds
from tests.validity.coverage import Coverage, Shares

N_RECORDINGS: Final = (20, 50, 100, 700)
# Fewer than the board takes, 10,000 and 9,999, and many more repetitions.
N_RESAMPLES: Final = 2_000
N_SIGN_FLIPS: Final = 1_999
N_METHODS: Final = 8
# A share of fewer repetitions is not shown.
MIN_SHOWN: Final = 200
# Recordings, how many of them make a day, and the correlation between two of a day.
DAYS: Final = (
    (150, 5, 0.0),
    (150, 5, 0.05),
    (150, 5, 0.2),
    (700, 10, 0.05),
    (700, 10, 0.2),
    (700, 35, 0.05),
    (700, 35, 0.2),
)

COVERAGE_HEAD: Final = (
    "errors",
    "recordings",
    "shown",
    "worse mean",
    "other mean",
    "worse mean, shown",
    "difference",
    "difference, shown",
    "p ≤ 0.001",
    "p ≤ 0.001, shown",
)
RANKS_HEAD: Final = (
    "methods",
    "quoted row",
    "recordings",
    "correlation of methods",
    "all ranges hold",
    "one range holds",
    "mean width",
)
DOMINATED_HEAD: Final = (
    "methods",
    "recordings",
    "alike: all ranges hold",
    "last worse by 15%: all ranges hold",
    "last marked as possibly the best",
)
RARE_HEAD: Final = (
    "expected errors of each method",
    "mean: interval shown",
    "mean: it holds",
    "difference: interval shown",
    "difference: it holds",
    "detectable difference found",
)
PAPERS_HEAD: Final = ("recordings", "correlation of methods", "all ranges hold beside 2 rows of papers")
FAILING_HEAD: Final = ("failures", "recordings", "mean that fails", "difference: p < 0.05", "p ≤ 0.001")
DETECTABLE_HEAD: Final = ("differences", "recordings", "detectable difference found", "90% / 10% quantile")
VERDICTS_HEAD: Final = ("methods", "a winner by uncorrected p", "corrected for all pairs")
DAYS_HEAD: Final = (
    "recordings",
    "of a day",
    "correlation",
    "units",
    "worse mean",
    "difference",
    "p ≤ 0.001",
    "all ranges hold",
)
Row = tuple[object, ...]


def models() -> tuple[error_models.Model, ...]:
    """Models of the coverage table; those that break the test's assumption come last."""
    return (*error_models.available(), error_models.ONE_FAILS)


def coverage_of(
    model: error_models.Model, n_recordings: int, *, n: int, by_day: int | None = None
) -> Coverage:
    """One cell of the tables."""
    units = coverage.as_drawn if by_day is None else coverage.days_of(by_day)
    return coverage.coverage(
        model,
        n_recordings=n_recordings,
        n=n,
        n_resamples=N_RESAMPLES,
        n_flips=N_SIGN_FLIPS,
        rng=np.random.default_rng([n_recordings, *model.name.encode()]),
        units=units,
    )


def coverage_rows(n: int) -> Iterator[Row]:
    """How often intervals hold the truth, in all repetitions and where the board shows them."""
    for model in models():
        for n_recordings in N_RECORDINGS:
            # As costly as all the others together: a third of the repetitions.
            n_here = n // 3 if n_recordings == max(N_RECORDINGS) else n
            yield coverage_row(model, n_recordings, coverage_of(model, n_recordings, n=n_here))


def coverage_row(model: error_models.Model, n_recordings: int, simulated: Coverage) -> Row:
    """One row of the table; of the means the worse one first, as it is in all repetitions."""
    if simulated.n_contradictions:
        raise AssertionError(f"{model}, {n_recordings} recordings: intervals and p contradict each other")
    worse = int(np.argmin(simulated.all.of_means))

    def cell(share: Callable[[Shares], float], shares: Shares, *, decimals: int = 1) -> str:
        return percent(share(shares), shares.n, decimals=decimals) if shares.n >= MIN_SHOWN else "–"

    return (
        model,
        n_recordings,
        f"{100 * simulated.share_shown:.0f} %",
        cell(lambda shares: shares.of_means[worse], simulated.all),
        cell(lambda shares: shares.of_means[1 - worse], simulated.all),
        cell(lambda shares: shares.of_means[worse], simulated.shown),
        cell(lambda shares: shares.of_difference, simulated.all),
        cell(lambda shares: shares.of_difference, simulated.shown),
        cell(lambda shares: shares.up_to_1_permille, simulated.all, decimals=2),
        cell(lambda shares: shares.up_to_1_permille, simulated.shown, decimals=2),
    )


def sequences_rows(n: int) -> Iterator[Row]:
    """How often a test of single sequences is wrong."""
    for n_recordings in (100, 300, 700):
        for rho in (0.05, 0.2):
            rng = np.random.default_rng([n_recordings, int(100 * rho)])
            share = coverage.by_sequences(rho, n_recordings=n_recordings, n=n // 3, rng=rng)
            yield n_recordings, rho, percent(share, n // 3)


def ranks_rows(n: int) -> Iterator[Row]:
    """How often all rank ranges of a column hold at once, in half as many repetitions."""
    rows: list[tuple[tuple[float, ...], float, bool, int]] = [
        (levels, 0.0, False, g) for levels in fields.LEVELS.values() for g in (100, 300, 700)
    ]
    rows += [((0.0,) * n_methods, rho, True, 100) for n_methods in (5, 10, 50) for rho in fields.SHARED]
    for levels, rho, with_quoted_row, n_recordings in rows:
        rng = np.random.default_rng([n_recordings, len(levels), int(10 * rho), with_quoted_row])
        ranks = fields.ranks(
            levels,
            n_recordings=n_recordings,
            correlation=rho,
            with_quoted_row=with_quoted_row,
            n=n // 2,
            rng=rng,
        )
        name = f"{len(levels)}, {'alike' if not any(levels) else 'spread'}"
        yield name, "yes" if with_quoted_row else "no", n_recordings, rho, *_rank_cells(ranks)


def odd_rows(n: int) -> Iterator[Row]:
    """The same of ten equally good methods; one of them comes to its mean by another route."""
    for name in ("informative", "one fails"):
        for n_recordings in (50, 100, 700):
            rng = np.random.default_rng([n_recordings, *name.encode()])
            draw = worlds.one_odd(name, n_methods=10)
            means = np.ones(10)
            ranks = fields.ranks_of(draw, means=means, n_recordings=n_recordings, n=n // 2, rng=rng)
            yield f"10, one odd: {name}", "no", n_recordings, "–", *_rank_cells(ranks)


def dominated_rows(n: int) -> Iterator[Row]:
    """The same where one recording has most of a method's error; how often a worse one is still marked."""
    for n_methods, n_recordings in itertools.product((3, 8), (40, 150, 700)):
        cells: list[str] = []
        for worse in (None, 1.15):
            ranks = fields.ranks_of(
                worlds.dominated(n_methods=n_methods, worse=worse),
                means=np.array([1.0] * (n_methods - 1) + [worse or 1.0]),
                n_recordings=n_recordings,
                n=n // 6,
                rng=np.random.default_rng([n_methods, n_recordings]),
            )
            cells.append(percent(ranks.all_at_once, ranks.n))
        yield n_methods, n_recordings, *cells, percent(ranks.last_marked, ranks.n)


def _rank_cells(ranks: fields.Ranks) -> Row:
    return percent(ranks.all_at_once, ranks.n), percent(ranks.each, ranks.n), f"{ranks.mean_width:.1f}"


def rare_rows(n: int) -> Iterator[Row]:
    """How often intervals hold where errors are rare; 700 recordings."""
    for n_expected in (1, 3, 6, 10, 20, 50, 200):
        result = rare.rare(
            n_expected,
            n_recordings=700,
            n=n // 6,
            n_flips=N_SIGN_FLIPS,
            n_resamples=N_RESAMPLES,
            rng=np.random.default_rng(n_expected),
        )
        shown = (round(share * result.n) for share in (result.mean_shown, result.difference_shown))
        cells = [
            percent(result.mean_shown, result.n),
            percent(result.mean, next(shown)),
            percent(result.difference_shown, result.n),
            percent(result.difference, next(shown)),
            percent(result.power, result.n),
        ]
        yield n_expected, *cells


def papers_rows(n: int) -> Iterator[Row]:
    """How often all ranges of 8 equal methods hold if papers' values come from the same recordings."""
    for n_recordings, rho in itertools.product((40, 150), fields.SHARED):
        rng = np.random.default_rng([n_recordings, int(10 * rho)])
        share = fields.all_hold_beside_sampled_papers(
            n_methods=8, n_papers=2, n_recordings=n_recordings, correlation=rho, n=n // 6, rng=rng
        )
        yield n_recordings, rho, percent(share, n // 6)


def failing_rows(n: int) -> Iterator[Row]:
    """What failures in 2% of recordings do, where they are very bad."""
    for times, n_recordings in itertools.product((10.0, 25.0), (40, 150, 700)):
        model = worlds.failing_model(share=0.02, times=times)
        n_here = n // 12 if n_recordings == max(N_RECORDINGS) else n // 3
        shares = coverage_of(model, n_recordings, n=n_here).shown
        cells = (shares.of_means[1], shares.below_5_percent, shares.up_to_1_permille)
        yield model, n_recordings, *(percent(cell, shares.n) for cell in cells)


def detectable_rows(n: int) -> Iterator[Row]:
    """How often the detectable difference is found."""
    for name, n_recordings in itertools.product(detectable.SHAPES, (50, 150)):
        result = detectable.detectable(
            name,
            n_recordings=n_recordings,
            n=n // 3,
            n_flips=N_SIGN_FLIPS,
            rng=np.random.default_rng([n_recordings, *name.encode()]),
        )
        yield name, n_recordings, percent(result.power, result.n), f"{result.ratio:.1f}"


def formulas_rows(_n: int) -> Iterator[Row]:
    """Figures that follow from formulas."""
    yield from formulas.formulas()


def verdicts_rows(n: int) -> Iterator[Row]:
    """How often a page of a few methods of one mean names a winner; 150 recordings."""
    fields_of = {
        f"{n_methods} alike": (n_methods, worlds.in_days(1, 0.0, n_methods=n_methods)) for n_methods in (3, 5)
    }
    for name in ("informative", "one fails"):
        fields_of[f"3, one odd: {name}"] = 3, worlds.one_odd(name, n_methods=3)
    for name, (n_methods, draw) in fields_of.items():
        result = verdicts.verdicts(
            draw,
            n_methods=n_methods,
            n_recordings=150,
            n=n // 6,
            n_flips=N_SIGN_FLIPS,
            rng=np.random.default_rng([n_methods, *name.encode()]),
        )
        yield name, percent(result.uncorrected, result.n), percent(result.corrected, result.n)


def days_rows(n: int) -> Iterator[Row]:
    """The same shares where recordings of one day are alike, with recordings and with days as units."""
    for n_recordings, per_day, rho in DAYS:
        model = worlds.day_model(per_day, rho)
        for unit in ("recording", "day"):
            simulated = coverage_of(model, n_recordings, n=n // 4, by_day=per_day if unit == "day" else None)
            draw = worlds.in_days(per_day, rho, n_methods=N_METHODS)
            if unit == "day":
                draw = worlds.by_day(draw, per_day=per_day)
            rng = np.random.default_rng([n_recordings, per_day, int(100 * rho)])
            ranks = fields.ranks_of(
                draw, means=np.ones(N_METHODS), n_recordings=n_recordings, n=n // 20, rng=rng
            )
            shares = simulated.all
            cells = [percent(share, shares.n) for share in (min(shares.of_means), shares.of_difference)]
            small = percent(shares.up_to_1_permille, shares.n, decimals=2)
            yield n_recordings, per_day, rho, unit, *cells, small, percent(ranks.all_at_once, ranks.n)


TABLES: Final[dict[str, tuple[Row, Callable[[int], Iterator[Row]]]]] = {
    "coverage": (COVERAGE_HEAD, coverage_rows),
    "sequences": (("recordings", "ρ", "z-test by sequences"), sequences_rows),
    "ranks": (RANKS_HEAD, ranks_rows),
    "odd": (RANKS_HEAD, odd_rows),
    "dominated": (DOMINATED_HEAD, dominated_rows),
    "rare": (RARE_HEAD, rare_rows),
    "papers": (PAPERS_HEAD, papers_rows),
    "failing": (FAILING_HEAD, failing_rows),
    "detectable": (DETECTABLE_HEAD, detectable_rows),
    "days": (DAYS_HEAD, days_rows),
    "formulas": (("figure", "value"), formulas_rows),
    "verdicts": (VERDICTS_HEAD, verdicts_rows),
}


def main() -> None:
    """Print tables, row by row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", nargs="*", default=list(TABLES), help=", ".join(TABLES))
    parser.add_argument("--repetitions", type=int, default=6_000)
    options = parser.parse_args()
    for name in options.tables:
        head, rows = TABLES[name]
        sys.stdout.write(f"\n{line(head)}\n{line(['---'] * len(head))}\n")
        for row in rows(options.repetitions):
            sys.stdout.write(f"{line(row)}\n")
            sys.stdout.flush()


def line(cells: Sequence[object]) -> str:
    """A row of a table."""
    return f"| {' | '.join(map(str, cells))} |"


if __name__ == "__main__":
    main()
