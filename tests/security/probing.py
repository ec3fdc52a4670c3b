"""What one more submission tells of hidden labels, with two decimals and with the one that is published.

    python -m tests.security.probing --readouts 6  the tables of docs/hidden-values.md, ten minutes
    python -m tests.security.probing --quick       small ones

File 0 is one of two files, `BASES`. *near* predicts 0.05 s for every sequence, which is below every true
value; *good* is a good file, such as anybody sends. File 1 moves one prediction in each of K recordings, each
by an amount of its own. So it moves the sum of MiD of one range by a known amount, and of no other. What is
published of file 1 beside file 0 then tells which ranges the chosen sequences are in.

Two things are in favour of the attacker. With the good file an amount depends a little on the label; here the
attacker knows it exactly. And file 1 of *near* is linear only if no chosen object is nearer than 0.48 s.

The decoder here is the best that there is: it computes what would be published under every hypothesis about
the labels, keeps the hypotheses that fit, weighs them by how common each range is, and names the likeliest
range of each sequence. `bits` is what it has learnt: −log2 of the share of hypotheses that fit.
"""

import argparse
import itertools
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evaluator import Difference, rounded
from evaluator.scoring.differences import rounded_difference, sign_flips
from evaluator.scoring.uncertainty import Bootstrap

if TYPE_CHECKING:
    from leaderboard.models import Edition

Floats = NDArray[np.float64]
Masks = NDArray[np.int64]

RANGES: Final = ("crucial", "small", "large", "negative")
SHARES: Final = np.array([0.09, 0.20, 0.43, 0.264])  # of all sequences; the rest is out of range

# Predictions lie within ln α10 = ± ln 3, and MiD is 10⁴ times the distance of two of them.
LIMIT: Final = np.log(3) * 1e4
# The true value of an object that is 0.48 s away: no label of the dataset is nearer.
NEAREST: Final = 0.19 * 1e4


@dataclass(frozen=True)
class Base:
    """A kind of file 0, and the largest amount by which file 1 can change the MiD of a sequence.

    `sign` is −1 where a move lowers the error.
    """

    name: str
    largest: float
    sign: int


NEAR: Final = Base("near: 0.05 s for every sequence", LIMIT - NEAREST, -1)
GOOD: Final = Base("good: errors as those of a method", LIMIT, +1)
BASES: Final = (NEAR, GOOD)
# Amounts run down to a 128th: powers of two where 8 sequences are chosen.
SPREAD: Final = 128.0
# Public methods of other teams, with which both files are compared.
MOST_RIVALS: Final = 8


@dataclass(frozen=True)
class World:
    """A hidden truth of G recordings, and K sequences whose ranges an attacker wants to know.

    `counts` are the sequences per recording and range, (G, 4); `base` and `rivals` the sums of MiD of file 0,
    and of R methods of other teams, (R, G, 4). Sequence i is in recording i, is moved by `amounts[i]`, and is
    in the range `labels[i]`; 4 is out of range.
    """

    counts: Floats
    base: Floats
    rivals: Floats
    amounts: Floats
    labels: NDArray[np.int64]

    @property
    def n_chosen(self) -> int:
        return len(self.amounts)

    def mask(self, column: int) -> int:
        """The chosen sequences that are in a range, as bits."""
        return sum(1 << i for i in range(self.n_chosen) if self.labels[i] == column)

    def moved(self, masks: Masks) -> Floats:
        """What file 1 adds to the sums of a range, if these are the chosen sequences in it: (G, masks)."""
        return self._added(masks, self.amounts)

    def warned(self, column: int, masks: Masks) -> Floats:
        """What file 1 adds to the sums of the warning error, if no prediction of file 0 warns: (G, masks)."""
        # As if a warning were due in all of the crucial range, and every moved prediction crossed 2.7 s.
        return self._added(masks, np.full(self.n_chosen, -100.0 if column == 0 else 100.0))

    def _added(self, masks: Masks, amounts: Floats) -> Floats:
        added = np.zeros((len(self.counts), len(masks)))
        added[: self.n_chosen] = ((masks >> np.arange(self.n_chosen)[:, None]) & 1) * amounts[:, None]
        return added


def world(
    *, n_chosen: int, n_sequences: int, n_recordings: int, rng: np.random.Generator, base: Base = NEAR
) -> World:
    """A world of recordings of very different sizes, in which each has its own mean of ln α10."""
    sizes = rng.lognormal(0, 0.8, n_recordings)
    sizes = np.maximum(sizes / sizes.sum() * n_sequences, 4)
    shares = rng.dirichlet(12 * np.append(SHARES, 1 - SHARES.sum()), n_recordings)[:, :4]
    counts = np.maximum(np.round(sizes[:, None] * shares), 1.0)
    of_ranges = np.array([0.06, 0.024, 0.009, -0.01])  # ln(1 / α10)
    log_ratios = of_ranges * rng.lognormal(0, 0.2, (n_recordings, 4))
    noise = rng.gamma(2.0, 20.0, (MOST_RIVALS, n_recordings, 4))
    errors = {NEAR: LIMIT - 1e4 * log_ratios, GOOD: rng.gamma(2.0, 7.0, (n_recordings, 4))}[base]
    amounts = base.largest / SPREAD ** (np.arange(n_chosen) / max(n_chosen - 1, 1))
    return World(
        counts=counts,
        base=counts * errors,
        rivals=counts * noise,
        amounts=rng.permutation(amounts) * base.sign,
        labels=rng.choice(5, n_chosen, p=np.append(SHARES, 1 - SHARES.sum())),
    )


# --- what is published of one range, under many hypotheses -----------------------------------------------

Answers = Sequence[tuple[float | str | None, ...]]
Channel = Callable[[World, int, Masks], Answers]


def all_that_is_left(world: World, column: int, masks: Masks) -> Answers:
    """All that is published, for a reader who knows the secret and every other label: more than anyone knows.

    The mean and its interval, and difference, interval and class of p next to another team's public method.
    """
    return _published_beside(1, world, column, masks)


def beside_many(world: World, column: int, masks: Masks) -> Answers:
    """The same next to the public methods of eight other teams."""
    return _published_beside(MOST_RIVALS, world, column, masks)


def _published_beside(n_rivals: int, world: World, column: int, masks: Masks) -> Answers:
    sums = world.base[:, [column]] + world.moved(masks)
    return _published_of(world.counts[:, [column]], sums, rivals=world.rivals[:n_rivals, :, [column]])


def with_warnings(world: World, column: int, masks: Masks) -> Answers:
    """The mean of the warning error, for a reader who knows exactly how often file 0 is wrong."""
    n = world.counts[:, column].sum()
    sums = _warning_base(world, column).sum() + world.warned(column, masks).sum(axis=0)
    return [(rounded(total / n, decimals=1),) for total in sums.tolist()]


def all_with_warnings(world: World, column: int, masks: Masks) -> Answers:
    """All that is published of both errors, for the reader of `all_that_is_left`."""
    sums = _warning_base(world, column) + world.warned(column, masks)
    counts = world.counts[:, [column]]
    warnings = _published_of(counts, sums, rivals=counts[None] * 5)
    return [
        (*one, *other) for one, other in zip(all_that_is_left(world, column, masks), warnings, strict=True)
    ]


def _warning_base(world: World, column: int) -> Floats:
    return world.counts[:, [column]] * (100.0 if column == 0 else 0.0)


def _published_of(counts: Floats, sums: Floats, *, rivals: Floats) -> Answers:
    """What is published of each of these sums of one error (G, hypotheses), and of rivals (R, G, 1)."""
    from leaderboard.models import Edition, Split  # noqa: PLC0415 - needs Django's settings
    from leaderboard.statistics import disclosure  # noqa: PLC0415 - likewise

    edition = Edition(split=Split(is_hidden=True), decimals=1)
    low, high = Bootstrap(counts, rng=np.random.default_rng(2)).intervals(sums.T[:, :, None])
    ends = np.concatenate(disclosure.published_ends(low, high, edition=edition), axis=1)
    answers: list[tuple[float | str | None, ...]] = [
        (*map(repr, ends[i].tolist()), rounded(total / counts.sum(), decimals=1))
        for i, total in enumerate(sums.sum(axis=0).tolist())
    ]
    for rival in rivals:
        differences = _published_differences(counts, sums, rival=rival, edition=edition)
        answers = [(*answer, *difference) for answer, difference in zip(answers, differences, strict=True)]
    return answers


def _published_differences(counts: Floats, sums: Floats, *, rival: Floats, edition: "Edition") -> Answers:
    """What is published of the difference of each of these sums (G, hypotheses) from a rival's (G, 1)."""
    from leaderboard.statistics import disclosure  # noqa: PLC0415 - needs Django's settings

    gaps = sums - rival
    flips = sign_flips(gaps, np.repeat(counts, sums.shape[1], axis=1), rng=np.random.default_rng(3))
    answers = []
    for i, total in enumerate(sums.sum(axis=0).tolist()):
        gap = Difference(
            float(gaps[:, i].sum() / counts.sum()),
            float(flips.low[i]),
            float(flips.high[i]),
            float(flips.p[i]),
        )
        mean, other = total / counts.sum(), rival.sum() / counts.sum()
        shown = rounded_difference(gap, first=mean, second=other, decimals=1)
        public = disclosure.published_difference(gap, shown, edition=edition)
        answers.append((public.low, public.high, public.p_below))
    return answers


# --- the decoder -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Readout:
    """What came of one readout: how many of the chosen sequences were named rightly, and the bits learnt."""

    n_right: int
    bits: float


def read(world: World, *, decimals: int, channel: Channel | None = None) -> Readout:
    """Decode one readout: the means of both files with `decimals`, and what a channel adds."""
    masks = np.arange(1 << world.n_chosen, dtype=np.int64)
    n_set = np.bitwise_count(masks).astype(np.int64)
    weights = [
        np.where(_fit(world, column, masks, decimals, channel), SHARES[column] ** n_set, 0.0)
        for column in range(len(RANGES))
    ]
    weights.append((1 - SHARES.sum()) ** n_set)
    whole = masks[-1]
    likely = np.zeros((len(weights), world.n_chosen))
    for i, weight in enumerate(weights):
        rest = weights[:i] + weights[i + 1 :]
        others = _either(_either(rest[0], rest[1]), _either(rest[2], rest[3]))
        both = weight * others[whole ^ masks]
        likely[i] = [both[(masks >> k) & 1 == 1].sum() for k in range(world.n_chosen)]
    total = float(likely[:, 0].sum())
    named = likely.argmax(axis=0)
    return Readout(n_right=int((named == world.labels).sum()), bits=-float(np.log2(total)))


def _fit(
    world: World, column: int, masks: Masks, decimals: int, channel: Channel | None
) -> NDArray[np.bool_]:
    """Which of the sets of chosen sequences may be those of a range, by all that is published of it."""
    n, base = world.counts[:, column].sum(), world.base[:, column].sum()
    sums = world.moved(masks).sum(axis=0)
    truth = world.mask(column)
    before, after = (rounded(total / n, decimals=decimals) for total in (base, base + sums[truth]))
    assert before is not None
    assert after is not None
    # Either mean is rounded: their difference is known to one unit of the last digit.
    fits = np.abs(sums / n - (after - before)) <= 10.0**-decimals * (1 + 1e-9)
    if channel is None:
        return fits
    candidates = masks[fits]
    for start in range(0, len(candidates), 256):
        some = candidates[start : start + 256]
        # In one product, so that the same hypothesis gives the same answer to the last bit.
        wanted, *answers = channel(world, column, np.append(truth, some))
        fits[some] = [answer == wanted for answer in answers]
    fits[truth] = True
    return fits


def _either(one: Floats, other: Floats) -> Floats:
    """The weight of each set of sequences as a set of the one kind and a disjoint set of the other."""
    ones, others = np.flatnonzero(one), np.flatnonzero(other)
    if len(ones) > len(others):
        return _either(other, one)
    weights = np.zeros_like(one)
    for mask in ones.tolist():
        disjoint = others[(others & mask) == 0]
        weights[disjoint | mask] += one[mask] * other[disjoint]
    return weights


# --- the table -------------------------------------------------------------------------------------------

WAYS: Final[dict[str, tuple[int, Channel | None]]] = {
    "means, two decimals": (2, None),
    "means, one decimal, as published": (1, None),
    "the same and the warning error": (1, with_warnings),
    "bound, if all but the chosen labels were known": (1, all_that_is_left),
    "the same beside 8 other public methods, bound": (1, beside_many),
    "the same and the warning error, bound": (1, all_with_warnings),
}


class Mean(NamedTuple):
    """A mean over readouts, and its standard error."""

    value: float
    error: float

    def __str__(self) -> str:
        return f"{self.value:5.1f} ± {self.error:.1f}"


def _mean(values: Sequence[float]) -> Mean:
    error = float(np.std(values, ddof=1) / len(values) ** 0.5) if len(values) > 1 else float("nan")
    return Mean(float(np.mean(values)), error)


def measured(
    *,
    n_chosen: int,
    n_sequences: int,
    n_recordings: int,
    n_readouts: int,
    base: Base = NEAR,
    seed: int = 0,
) -> dict[str, tuple[Mean, Mean]]:
    """For each way the sequences named rightly and the bits, each with its mean and its standard error."""
    readouts_by_way: dict[str, list[Readout]] = {name: [] for name in WAYS}
    for k in range(n_readouts):
        rng = np.random.default_rng((seed, k))
        of = world(n_chosen=n_chosen, n_sequences=n_sequences, n_recordings=n_recordings, rng=rng, base=base)
        for name, (decimals, channel) in WAYS.items():
            readouts_by_way[name].append(read(of, decimals=decimals, channel=channel))
    return {
        name: (_mean([each.n_right for each in readouts]), _mean([each.bits for each in readouts]))
        for name, readouts in readouts_by_way.items()
    }


def main() -> None:
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "leaderboard.settings")
    import django  # noqa: PLC0415 - the settings have to be named first

    django.setup()
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--readouts", type=int, default=0)
    parser.add_argument("--chosen", type=int, nargs="*", help="how many sequences; above 12 takes an hour")
    options = parser.parse_args()
    chosen = options.chosen or ((8,) if options.quick else (8, 12))
    n_readouts = options.readouts or (3 if options.quick else 12)
    for (n_sequences, n_recordings), n_chosen, base in itertools.product(
        ((4_000, 100), (28_600, 400)), chosen, BASES
    ):
        sys.stdout.write(
            f"{n_sequences:,} sequences, {n_recordings} recordings, {n_chosen} chosen, {n_readouts} "
            f"readouts, file 0 {base.name}; always naming “large”: {SHARES[2] * n_chosen:.1f}\n"
        )
        table = measured(
            n_chosen=n_chosen,
            n_sequences=n_sequences,
            n_recordings=n_recordings,
            n_readouts=n_readouts,
            base=base,
        )
        for name, (n_right, bits) in table.items():
            sys.stdout.write(f"  {name:<52} {n_right} right, {bits} bits\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
