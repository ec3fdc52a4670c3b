"""Weights for tests: random ones, and checkpoints as torch writes them, made without torch."""

import io
import zipfile
from collections.abc import Mapping
from math import prod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tsttc_baselines.deep_scale.weights import SHAPES

Tensors = dict[str, NDArray[np.float32]]


def random_tensors(seed: int = 0) -> Tensors:
    """Tensors of the network that let something through."""
    rng = np.random.default_rng(seed)
    tensors: Tensors = {}
    for name, shape in SHAPES.items():
        if name.endswith(("running_var", "bn.weight")):
            tensors[name] = rng.uniform(0.5, 1.5, shape).astype(np.float32)
        else:
            spread = np.sqrt(2 / max(1, prod(shape[1:])))
            tensors[name] = (spread * rng.normal(size=shape)).astype(np.float32)
    tensors["backbone.stem.bn.running_var"] *= 5000.0
    return tensors


def text(value: str) -> bytes:
    data = value.encode()
    return b"X" + len(data).to_bytes(4, "little") + data


def numbers(values: tuple[int, ...]) -> bytes:
    return b"(" + b"".join(b"I%d\n" % value for value in values) + b"t"


def tensor(
    key: int, shape: tuple[int, ...], *, n_items: int, kind: str = "FloatStorage", offset: int = 0
) -> bytes:
    """The opcodes of one tensor, in rows that follow each other."""
    strides = tuple(prod(shape[axis + 1 :]) for axis in range(len(shape)))
    storage = b"(" + text("storage") + f"ctorch\n{kind}\n".encode()
    storage += text(str(key)) + text("cuda:0") + b"I%d\ntQ" % n_items
    hooks = b"I00\nccollections\nOrderedDict\n)R"
    body = storage + b"I%d\n" % offset + numbers(shape) + numbers(strides) + hooks
    return b"ctorch._utils\n_rebuild_tensor_v2\n(" + body + b"tR"


def model(tensors: Mapping[str, NDArray[np.float32]]) -> bytes:
    """The pickle of a checkpoint with these tensors and a counter, as the toolkit's have it."""
    items = b"".join(
        text(name) + tensor(key, values.shape, n_items=values.size)
        for key, (name, values) in enumerate(tensors.items())
    )
    counter = text("backbone.stem.bn.num_batches_tracked") + tensor(999, (), n_items=1, kind="LongStorage")
    state = b"}(" + text("_metadata") + b"}ub"
    ordered = b"ccollections\nOrderedDict\n)R(" + items + counter + b"u" + state
    return b"\x80\x02}(" + text("model") + ordered + text("start_epoch") + b"I36\nu."


def checkpoint(tensors: Tensors, *, pickled: bytes | None = None) -> bytes:
    """A checkpoint as torch writes it."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("latest_ckpt/data.pkl", model(tensors) if pickled is None else pickled)
        for key, values in enumerate(tensors.values()):
            archive.writestr(f"latest_ckpt/data/{key}", values.astype("<f4").tobytes())
    return buffer.getvalue()


def written(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path
