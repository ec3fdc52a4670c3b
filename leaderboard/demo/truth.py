"""Simulated ground truth of the shape of the real test set: its size, recordings and TTC ranges."""

import numpy as np

import evaluator
from baselines import simulation
from leaderboard.demo.runs import N_RECORDINGS, N_SEQUENCES, SEED

SHAPE = simulation.SHAPES["test"]


def demo_split() -> simulation.Split:
    """The demo's split with the motion of its vehicles, from which its frames are rendered."""
    return simulation.split(
        rng=np.random.default_rng(SEED), n_sequences=N_SEQUENCES, n_recordings=N_RECORDINGS, shape=SHAPE
    )


def simulate(
    *, rng: np.random.Generator, n_sequences: int = N_SEQUENCES, n_recordings: int = N_RECORDINGS
) -> evaluator.GroundTruth:
    """Ground truth of tracks that are spread over recordings; the same generator gives the same values.

    A track is a run of windows cut without overlap, as in the dataset, of a vehicle in one of the paper's six
    driving scripts or in highway driving.
    """
    return simulation.split(rng=rng, n_sequences=n_sequences, n_recordings=n_recordings, shape=SHAPE).truth
