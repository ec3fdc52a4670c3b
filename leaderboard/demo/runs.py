"""The simulated split of the demo, and the runs whose files its teams submit.

`python -m leaderboard.demo.runs FOLDER [NAME …]` makes the estimates again; the frames take about 2 GB.
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
        """Return the command that makes the file from the rendered frames."""
        options = "".join(f" --{name.replace('_', '-')} {value}" for name, value in self.parameters.items())
        return f"tsttc baseline run {self.method} frames/ --out {self.name}.json{options}"

    @property
    def path(self) -> Path:
        return FOLDER / f"{self.name}.npz"

    def keep(self, scale_ratio: Floats) -> None:
        """Write the estimates, (n,) in ascending anno_id."""
        FOLDER.mkdir(exist_ok=True)
        millionths = np.round(scale_ratio * 10**DECIMALS).astype(np.uint32)
        with self.path.open("wb") as file:
            np.savez_compressed(file, millionths=millionths)

    def kept(self) -> Floats:
        """Read the estimates, (n,) in ascending anno_id. Raises `OSError` without any."""
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
    """Return the run of that name. Raises `KeyError`."""
    return {run.name: run for run in RUNS}[name]


SHAPE = simulation.SHAPES["test"]


def demo_split() -> simulation.Split:
    return simulation.split(
        rng=np.random.default_rng(SEED), n_sequences=N_SEQUENCES, n_recordings=N_RECORDINGS, shape=SHAPE
    )


def simulate(
    *, rng: np.random.Generator, n_sequences: int = N_SEQUENCES, n_recordings: int = N_RECORDINGS
) -> evaluator.GroundTruth:
    """Make ground truth of tracks spread over recordings; a track is cut into windows, as in the dataset."""
    return simulation.split(rng=rng, n_sequences=n_sequences, n_recordings=n_recordings, shape=SHAPE).truth


def make(folder: Path, *, names: Sequence[str]) -> None:
    """Render the frames in a folder, and keep the estimates of the runs of these names."""
    folder.mkdir(parents=True, exist_ok=True)
    runs = [get_run(name) for name in names or [run.name for run in RUNS]]
    for command in (FRAMES, *(run.command for run in runs)):
        subprocess.run(shlex.split(command), cwd=folder, check=True)  # noqa: S603 - our own commands
    manifest = evaluator.read_manifest(folder / "frames" / "manifest.csv")
    for run in runs:
        values = json.loads((folder / f"{run.name}.json").read_text())["predictions"]
        run.keep(np.array([values[key] for key in manifest.natural_keys])[manifest.rows_by_id])


if __name__ == "__main__":
    make(Path(sys.argv[1]), names=sys.argv[2:])
