"""Made-up and real errors of two methods whose true means are known, for simulations of confidence intervals.

A recording is drawn with its number of sequences n and the sums of both methods' errors over them. In every
model both methods have the same true mean, E[S] / E[n]; the models differ in how they come to it. Most take
the lengths of recordings from one log-normal table (5 to 500 sequences, median 40), which is more unequal
than the real test set. Made-up errors have a mean near 1.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from statistics import NormalDist
from typing import Final

import numpy as np
from numpy.typing import NDArray

import evaluator

Floats = NDArray[np.float64]
Random = np.random.Generator

KITTI = Path(__file__).resolve().parents[2] / "shared" / "data" / "kitti-dev"

_LENGTHS: Final = np.clip(
    np.round([40 * np.exp(NormalDist().inv_cdf((i + 0.5) / 10_000)) for i in range(10_000)]), 5, 500
)
# The length at which "better on long recordings" turns into "better on short ones": E[n (1 − n / this)] = 0.
_BALANCE: Final = float((_LENGTHS**2).mean() / _LENGTHS.mean())


@dataclass(frozen=True)
class Drawn:
    """Recordings in rows, repetitions in columns, all (G, n): counts, and the error sums of two methods."""

    counts: Floats
    first: Floats
    second: Floats


@dataclass(frozen=True)
class Model:
    """One way in which errors may come about. `mean` is the true mean error of both methods."""

    name: str
    summary: str
    mean: Callable[[], float]
    draw: Callable[[int, int, Random], Drawn]

    def __str__(self) -> str:
        return self.name


# Of the variance of exponential errors, the part that a recording's sequences have in common.
_SHARE: Final = 0.2


def _lengths(n_recordings: int, n: int, rng: Random) -> Floats:
    return _LENGTHS[rng.integers(0, len(_LENGTHS), size=(n_recordings, n))]


def _summed(counts: Floats, draw: Callable[[int], NDArray[np.float32]]) -> Floats:
    """Sums of as many independent draws as each count says, in the shape of `counts`."""
    ends = np.cumsum(counts.ravel()).astype(np.int64)
    total = np.concatenate([[0.0], np.cumsum(draw(int(ends[-1])), dtype=np.float64)])
    return np.diff(total[np.concatenate([[0], ends])]).reshape(counts.shape)


def _effects(shape: tuple[int, int], sigma: Floats | float, rng: Random) -> tuple[Floats, Floats]:
    """Log-normal factors of mean 1 for two methods, which share half of the logarithm's variance."""
    shared, *own = rng.standard_normal((3, *shape))
    first, second = (np.exp(sigma * (shared + each) / 2**0.5 - np.square(sigma) / 2) for each in own)
    return first, second


def _log_normal(counts: Floats, rng: Random) -> tuple[Floats, Floats]:
    """Errors as skewed as real ones; a fifth of the logarithm's variance belongs to the recording."""
    sigma = 0.8**0.5

    def draw(total: int) -> NDArray[np.float32]:
        return np.exp(np.float32(sigma) * rng.standard_normal(total, dtype=np.float32) - np.float32(0.4))

    first, second = _effects((counts.shape[0], counts.shape[1]), 0.2**0.5, rng)
    return first * _summed(counts, draw), second * _summed(counts, draw)


def _heavy(n_recordings: int, n: int, rng: Random) -> Drawn:
    counts = _lengths(n_recordings, n, rng)
    return Drawn(counts, *_log_normal(counts, rng))


def _pareto(n_recordings: int, n: int, rng: Random) -> Drawn:
    counts = _lengths(n_recordings, n, rng)

    def draw(total: int) -> NDArray[np.float32]:
        return np.float32(0.6) * np.exp(rng.standard_exponential(total, dtype=np.float32) / np.float32(2.5))

    levels = 0.6 * np.exp(rng.standard_exponential((2, n_recordings, n)) / 2.5)
    first, second = (counts * 0.2 * level + 0.8 * _summed(counts, draw) for level in levels)
    return Drawn(counts, first, second)


def _zero(n_recordings: int, n: int, rng: Random) -> Drawn:
    counts = np.ceil(_lengths(n_recordings, n, rng) / 5)
    n_filled = rng.integers(20, 32, size=n)
    position = rng.permuted(np.broadcast_to(np.arange(n_recordings)[:, None], counts.shape), axis=0)
    counts = np.where(position < n_filled, counts, 0.0)
    return Drawn(counts, *_log_normal(counts, rng))


def _hetero(n_recordings: int, n: int, rng: Random) -> Drawn:
    counts = _lengths(n_recordings, n, rng)
    first, second = _effects((n_recordings, n), np.minimum(0.25 * np.sqrt(counts / 40), 0.8), rng)
    return Drawn(counts, first * rng.gamma(counts), second * rng.gamma(counts))


def _rare(n_recordings: int, n: int, rng: Random) -> Drawn:
    counts = _lengths(n_recordings, n, rng)
    common, _ = _effects((n_recordings, n), 0.5, rng)
    shared = 0.9 * common * rng.gamma(counts)
    fails = 2.0 * (rng.random((2, n_recordings, n)) < 0.05) * counts
    first, second = shared + 0.1 * rng.gamma(np.broadcast_to(counts, fails.shape)) + fails
    return Drawn(counts, first, second)


def _informative(n_recordings: int, n: int, rng: Random) -> Drawn:
    counts = _lengths(n_recordings, n, rng)
    tilt = 0.3 * (1 - counts / _BALANCE)
    first, second = _effects((n_recordings, n), 0.2**0.5, rng)
    return Drawn(counts, (1 + tilt) * first * rng.gamma(counts), (1 - tilt) * second * rng.gamma(counts))


def _one_fails(n_recordings: int, n: int, rng: Random) -> Drawn:
    counts = _lengths(n_recordings, n, rng)
    first, second = _effects((n_recordings, n), 0.2, rng)
    fails = 2.5 * (rng.random((n_recordings, n)) < 0.04) * counts
    return Drawn(counts, first * rng.gamma(counts), 0.9 * second * rng.gamma(counts) + fails)


def _exponential(n_recordings: int, n: int, rng: Random) -> Drawn:
    counts = 1 + np.asarray(rng.poisson(rng.gamma(2.0, 20.0, (n_recordings, n))), dtype=np.float64)
    return Drawn(counts, exponential_sums(counts, rng), exponential_sums(counts, rng))


def exponential_sums(counts: Floats, rng: Random) -> Floats:
    """Sums of exponential errors; a fifth of their variance belongs to the recording."""
    levels = rng.exponential(_SHARE**0.5, counts.shape)
    # The sum of n independent exponential errors is one gamma variable of shape n.
    return counts * levels + rng.gamma(counts, (1 - _SHARE) ** 0.5)


def odd_field(
    name: str, n_methods: int, n_recordings: int, n: int, rng: Random
) -> tuple[NDArray[np.float64], Floats]:
    """Sums of methods of one true mean, (methods, G, n), and the counts: all like the first, the last odd.

    It comes to its mean as the second method of `informative` or `one fails` does.
    """
    counts = _lengths(n_recordings, n, rng)
    shape = n_methods, n_recordings, n
    sigma = 0.2**0.5 if name == "informative" else 0.2
    shared, own = rng.standard_normal((n_recordings, n)), rng.standard_normal(shape)
    levels = np.exp(sigma * (shared + own) / 2**0.5 - sigma**2 / 2)
    sums = levels * rng.gamma(np.broadcast_to(counts, shape))
    if name == "informative":
        tilt = 0.3 * (1 - counts / _BALANCE)
        sums[:-1] *= 1 + tilt
        sums[-1] *= 1 - tilt
    else:
        sums[-1] = 0.9 * sums[-1] + 2.5 * (rng.random((n_recordings, n)) < 0.04) * counts
    return sums, counts


@lru_cache(maxsize=1)
def _tracks() -> Drawn:
    """MiD of two estimators on tracks of real driving, the second scaled to the first one's mean."""
    truth = evaluator.read_truth(KITTI / "truth.csv")
    errors = []
    for name in ("box-height", "box-sqrt-area"):
        data = (KITTI / "predictions" / f"{name}.ttc.json").read_bytes()
        predictions = evaluator.read_predictions(data, manifest=truth.manifest)
        report = evaluator.evaluate(predictions, truth, keep_sequences=True)
        assert report.sequences is not None
        errors.append(report.sequences["mid"])
    # bag_stamp/cam_id/ts/track_id without the moment: the track.
    tracks = [(key.split("/")[0], key.split("/")[3]) for key in truth.manifest.natural_keys]
    _, index = np.unique(np.array(tracks), axis=0, return_inverse=True)
    counts, first, second = (
        np.bincount(index.ravel(), weights=weights)[:, None] for weights in (np.ones_like(errors[0]), *errors)
    )
    return Drawn(counts, first, second * first.sum() / second.sum())


def _kitti(n_recordings: int, n: int, rng: Random) -> Drawn:
    tracks = _tracks()
    chosen = rng.integers(0, len(tracks.counts), size=(n_recordings, n))
    return Drawn(*(part[:, 0][chosen] for part in (tracks.counts, tracks.first, tracks.second)))


def _mean_of_tracks() -> float:
    return float(_tracks().first.sum() / _tracks().counts.sum())


MODELS: Final = (
    Model(
        "exponential",
        "exponential errors, a fifth of their variance the recording's",
        lambda: _SHARE**0.5 + (1 - _SHARE) ** 0.5,
        _exponential,
    ),
    Model("log-normal", "log-normal lengths and errors", lambda: 1.0, _heavy),
    Model(
        "Pareto", "errors of sequences and of recordings with Pareto tails of index 2.5", lambda: 1.0, _pareto
    ),
    Model("few", "a TTC range that occurs in 20 to 31 recordings, whatever their number", lambda: 1.0, _zero),
    Model("unequal", "errors that scatter the more, the longer the recording", lambda: 1.0, _hetero),
    Model("failures", "methods alike but for rare failures of whole recordings", lambda: 1.1, _rare),
    Model(
        "informative",
        "one method better on long recordings, the other on short ones",
        lambda: 1.0,
        _informative,
    ),
    Model("KITTI", "errors of two real estimators on the tracks of real driving", _mean_of_tracks, _kitti),
)
ONE_FAILS: Final = Model(
    "one fails",
    "one method better nearly everywhere, and far worse in 4 % of recordings",
    lambda: 1.0,
    _one_fails,
)


def available() -> tuple[Model, ...]:
    """The models that this machine can draw from: real driving is read in place, where it is."""
    return tuple(model for model in MODELS if model.name != "KITTI" or KITTI.is_dir())
