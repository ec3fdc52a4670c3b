"""Folders of annotation files as the dataset has them: pickles with attribute-dicts of foreign classes."""

import math
import os
import pickle
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

START_NS = 1_600_000_000_000_000_000
STEP_NS = 100_000_000


class _ItemsAndAttributes(dict[str, Any]):
    """Keeps every value twice, as easydict does: as an item and in `__dict__`."""

    def __init__(self, **values: Any) -> None:
        super().__init__(values)
        self.__dict__.update(values)


class _OwnNamespace(dict[str, Any]):
    """The common recipe `self.__dict__ = self`."""

    def __init__(self, **values: Any) -> None:
        super().__init__(values)
        self.__dict__ = self


class _ItemsOnly(dict[str, Any]):
    """Attributes by `__getattr__`, state by `__getstate__`, as addict does."""

    def __getstate__(self) -> "_ItemsOnly":
        return self

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.update(state)


class _AttributesOnly(dict[str, Any]):
    """No items at all: what is pickled is the `__dict__`."""

    def __init__(self, **values: Any) -> None:
        super().__init__()
        self.__dict__.update(values)


FOREIGN_CLASSES = {
    "easydict.EasyDict": _ItemsAndAttributes,
    "company.tools.attribute.AttrDict": _OwnNamespace,
    "addict.addict.Dict": _ItemsOnly,
    "munch.Munch": _OwnNamespace,
    "box.box.Box": _AttributesOnly,
}


@contextmanager
def foreign_class(name: str) -> Iterator[Callable[..., Any]]:
    """A class that pickles under a foreign name, importable only inside this block."""
    module_name, _, class_name = name.rpartition(".")
    cls = type(class_name, (FOREIGN_CLASSES[name],), {"__module__": module_name, "__qualname__": class_name})
    parts = module_name.split(".")
    packages = {".".join(parts[: n + 1]): ModuleType(".".join(parts[: n + 1])) for n in range(len(parts))}
    setattr(packages[module_name], class_name, cls)
    sys.modules.update(packages)
    try:
        yield cls
    finally:
        for package in packages:
            del sys.modules[package]


def seen(make: Callable[..., Any] = dict, *, frame: int, track: int = 7, **changes: Any) -> Any:
    """One object in one frame, with the values that the dataset's annotations have."""
    values = {
        "bag_stamp": "/data/bags/0007",
        "box2d": np.array([0.25, 0.25, 0.5, 0.5]),
        "cam_id": 1,
        "id": track,
        "occ_ratio": 0.0,
        "same_lane": np.True_,
        "ts": START_NS + frame * STEP_NS,
        "ttc_imu": np.float64(10.0 - 0.1 * frame),
    }
    return make(**(values | changes))


def camera(
    tracks: dict[int, list[int]], make: Callable[..., Any] = dict, **changes: Any
) -> dict[int, list[Any]]:
    """One camera: for every track the frames in which it is seen."""
    frames = sorted({frame for frames in tracks.values() for frame in frames})
    return {
        START_NS + frame * STEP_NS: [
            seen(make, frame=frame, track=track, **changes) for track, its in tracks.items() if frame in its
        ]
        for frame in frames
    }


def write_folder(folder: Path, files: Mapping[str, object], *, protocol: int = 4) -> Path:
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else pickle.dumps(content, protocol=protocol))
    return folder


# --- another machine's order ----------------------------------------------------------------------------

N_BAGS = 8


def ttc_of(bag: int, track: int, frame: int) -> float:
    """A time to contact that changes slowly along a track, and differs between tracks and recordings."""
    return (-1) ** track * (2.0 + 1.1 * track + 0.9 * (bag * 5 % N_BAGS) + 0.9 * math.cos(frame / 40 + bag))


def driving_folder(folder: Path) -> Path:
    """Recordings of three to seven objects each, which come and go."""
    rng = np.random.default_rng(5)
    for bag in range(N_BAGS):
        tracks = {
            track: [*range(start := int(rng.integers(20)), start + int(rng.integers(40, 70)))]
            for track in range(3 + bag * 3 % 5)
        }
        frames = camera(tracks, bag_stamp=f"bag{bag}")
        for objects in frames.values():
            for one in objects:
                one["ttc_imu"] = ttc_of(bag, one["id"], (one["ts"] - START_NS) // STEP_NS)
        write_folder(folder, {f"bag{bag}.pkl": [frames]})
    return folder


def list_backwards(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the file system list every folder in reverse order of names, as another one may."""
    real = os.walk

    def walk(top: Any, **options: Any) -> Iterator[tuple[str, list[str], list[str]]]:
        for directory, folders, names in real(top, **options):
            folders.sort(reverse=True)
            yield directory, folders, sorted(names, reverse=True)

    monkeypatch.setattr(os, "walk", walk)


def toolkit_results(folder: Path, *, error: float = 1.02) -> dict[str, tuple[str, float]]:
    """Natural key and prediction by the toolkit's anno_id, from a plain loop like the toolkit's."""
    predictions: dict[str, tuple[str, float]] = {}
    for directory, _, names in os.walk(folder):
        for name in names:
            for frames in pickle.loads(Path(directory, name).read_bytes()):
                sequences: dict[Any, list[Any]] = {}
                for _stamp, objects in sorted(frames.items()):
                    for one in objects:
                        before = sequences.get(one["id"], [])
                        is_next = bool(before) and one["ts"] - before[-1]["ts"] == STEP_NS
                        sequences[one["id"]] = [*before, one] if is_next else [one]
                    for track in [key for key, sequence in sequences.items() if len(sequence) == 6]:
                        last = sequences.pop(track)[-1]
                        bag = last["bag_stamp"].rsplit("/", 1)[-1]
                        key = f"{bag}/{last['cam_id']}/{last['ts']}/{last['id']}"
                        predictions[str(len(predictions))] = (key, error * float(last["ttc_imu"]))
    return predictions
