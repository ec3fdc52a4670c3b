"""Folders of real drives, for tests that need them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from numpy.typing import NDArray

from evaluator import read_truth
from evaluator.cli import main
from tests.services import shared_data
from tests.tsttc_baselines.real_folders import kitti_clip_folder, kitti_label_folder
from tsttc_baselines.clips import Clip
from tsttc_baselines.folders import read_folder
from tsttc_baselines.images import ImageCache


@pytest.fixture
def tsttc() -> Callable[..., Result]:
    """Run the command in this process."""

    def run(*arguments: object) -> Result:
        return CliRunner().invoke(main, list(map(str, arguments)), prog_name="tsttc")

    return run


@pytest.fixture(scope="session")
def kitti_clip() -> Path:
    """The folder of the clip with lidar distances."""
    shared = shared_data()
    if shared is None or not (shared / "kitti-clip").is_dir():
        pytest.skip("kitti-clip is not here: TSTTC_SHARED_DATA names no folder that has it")
    return shared / "kitti-clip"


@pytest.fixture(scope="session")
def real_clips(
    kitti_clip: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[list[Clip], NDArray[np.float64]]:
    """The clips of kitti-clip, and their true times to contact in seconds."""
    folder = read_folder(kitti_clip_folder(kitti_clip, tmp_path_factory.mktemp("kitti-clip")))
    cache = ImageCache()
    clips = [folder.clip(row, cache=cache) for row in range(folder.n_sequences)]
    return clips, read_truth(kitti_clip / "truth.csv").ttc_s


@pytest.fixture(scope="session")
def kitti_labels() -> Path:
    """The folder of KITTI's tracking labels."""
    shared = shared_data()
    if shared is None or not (shared / "kitti-labels").is_dir():
        pytest.skip("kitti-labels is not here: TSTTC_SHARED_DATA names no folder that has it")
    return shared / "kitti-labels"


@pytest.fixture(scope="session")
def kitti_folder(kitti: Path, kitti_labels: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The drives of kitti-dev as a folder of the convention without images; not to be written to."""
    return kitti_label_folder(kitti, kitti_labels, tmp_path_factory.mktemp("kitti-dev"))
