"""The simulated split of the demo, and the runs whose files its teams submit: what ran, and its estimates.

`python -m leaderboard.demo.runs FOLDER [NAME …]` makes them anew, with the commands that the descriptions
name; the frames in FOLDER take about 2 GB. Reading the estimates needs numpy alone.
"""

import json
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import evaluator
from tsttc_baselines import simulation
from tsttc_baselines.methods import Value

Floats = NDArray[np.float64]

FOLDER = Path(__file__).parent / "estimates"
DECIMALS = 6
"""Of a kept scale ratio."""

SEED = 20230904
N_SEQUENCES = 28_600
N_RECORDINGS = 700
FRAMES = (
    f"tsttc baseline render frames/ --like test --sequences {N_SEQUENCES} --recordings {N_RECORDINGS} "
    f"--seed {SEED}"
)
"""The command that renders the frames of the demo's split."""


@dataclass(frozen=True, slots=True)
class Run:
    """A method with its parameters, at a frame gap of 5; `name` is that of its file."""

    name: str
    method: str
    parameters: Mapping[str, Value] = field(default_factory=dict)

    @property
    def command(self) -> str:
        """The command that makes the file from the rendered frames."""
        options = "".join(f" --{name.replace('_', '-')} {value}" for name, value in self.parameters.items())
        return f"tsttc baseline run {self.method} frames/ --out {self.name}.json{options}"

    @property
    def path(self) -> Path:
        """Where its estimates are kept."""
        return FOLDER / f"{self.name}.npz"

    def keep(self, scale_ratio: Floats) -> None:
        """Write the estimates, (n,) in ascending anno_id."""
        FOLDER.mkdir(exist_ok=True)
        millionths = np.round(scale_ratio * 10**DECIMALS).astype(np.uint32)
        with self.path.open("wb") as file:
            np.savez_compressed(file, millionths=millionths)

    def kept(self) -> Floats:
        """The estimates, (n,) in ascending anno_id; raises `OSError` where none are kept."""
        with self.path.open("rb") as file, np.load(file, allow_pickle=False) as store:
            # A scale ratio of 0 cannot be submitted.
            return np.maximum(np.asarray(store["millionths"], dtype=np.float64), 1) / 10**DECIMALS


RUNS = (
    Run("alignment", "alignment"),
    Run("deep-scale", "deep-scale"),
    Run("deep-scale-head", "deep-scale", {"decoding": "head"}),
    Run("tracking", "tracking"),
    Run("pixel-mse", "pixel-mse"),
    Run("pixel-mse-toolkit", "pixel-mse", {"variant": "toolkit"}),
    Run("detection-height", "detection", {"measure": "height"}),
    Run("detection-sqrt-area", "detection", {"measure": "sqrt-area"}),
    Run("detection-area", "detection", {"measure": "area"}),
)


def get_run(name: str) -> Run:
    """The run of that name; raises `KeyError`."""
    return {run.name: run for run in RUNS}[name]


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


def make(folder: Path, *, names: Sequence[str]) -> None:
    """Render the frames in a folder, estimate with the runs of these names, and keep the estimates."""
    folder.mkdir(parents=True, exist_ok=True)
    runs = [get_run(name) for name in names or [run.name for run in RUNS]]
    for command in (FRAMES, *(run.command for run in runs)):
        subprocess.run(shlex.split(command), cwd=folder, check=True)  # noqa: S603 - our own commands
    for run in runs:
        values = json.loads((folder / f"{run.name}.json").read_text())["predictions"]
        run.keep(np.array([values[key] for key in sorted(values, key=int)]))


if __name__ == "__main__":
    make(Path(sys.argv[1]), names=sys.argv[2:])
