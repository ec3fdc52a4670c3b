"""Weights of the network: the project's own file, or the toolkit's checkpoint.

The own file is a zip without pickles: `card.json`, the use and origin of the weights, and an `.npy` per
tensor.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from math import prod
from pathlib import Path
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from evaluator.problems import Findings, reject
from tsttc_baselines.deep_scale.checkpoint import MAX_BYTES, Shape, open_archive, read_checkpoint, read_entry
from tsttc_baselines.deep_scale.network import Similarity

N_SCALES: Final = 20
CARD: Final = "card.json"
_HEADER_BYTES: Final = 128
"""Of an `.npy` file."""

Decoding = Literal["head", "fit"]
DECODINGS: Final[tuple[Decoding, ...]] = get_args(Decoding)

Tensors = Mapping[str, NDArray[np.float32]]


def _block(name: str, channels_out: int, channels_in: int, size: int) -> dict[str, Shape]:
    norm = {
        f"{name}.bn.{part}": (channels_out,) for part in ("weight", "bias", "running_mean", "running_var")
    }
    return {f"{name}.conv.weight": (channels_out, channels_in, size, size), **norm}


def _shapes() -> dict[str, Shape]:
    csp = "backbone.stage2.1"
    shapes = _block("backbone.stem", 12, 3, 7) | _block("backbone.stage2.0", 24, 12, 7)
    shapes |= _block(f"{csp}.conv1", 12, 24, 1) | _block(f"{csp}.conv2", 12, 24, 1)
    shapes |= _block(f"{csp}.conv3", 24, 24, 1)
    for number in range(3):
        shapes |= _block(f"{csp}.m.{number}.conv1", 12, 12, 1) | _block(f"{csp}.m.{number}.conv2", 12, 12, 3)
    shapes |= {"backbone.upsample.weight": (24, 24, 3, 3), "backbone.upsample.bias": (24,)}
    shapes |= _block("backbone.stage3.0", 24, 24, 7) | _block("backbone.stage3.1", 24, 24, 7)
    linear = {"head.scale_preds.weight": (N_SCALES, N_SCALES), "head.scale_preds.bias": (N_SCALES,)}
    return shapes | linear


SHAPES: Final = _shapes()
"""Every tensor of the network with its shape, in the order of the layers."""


@dataclass(frozen=True, slots=True)
class Use:
    """How weights are used; the defaults are the toolkit's.

    - `similarity`: "cosine" as in the paper, or "dot" (scalar product) for the toolkit's weights.
    - `n_cells`: cells of the target's box in each direction, the paper's target size.
    - `max_box_px`: frames are shrunk until the longer side of the target's box has at most so many pixels.
    - `margin_px`: pixels around what is compared.
    - `decoding`: "head" for the paper's estimate, or "fit" for the fit of the features.
    """

    similarity: Similarity = "dot"
    n_cells: int = 50
    max_box_px: float = 120.0
    margin_px: float = 16.0
    decoding: Decoding = "head"


@dataclass(frozen=True, eq=False)
class Weights:
    """The weights of a network.

    - `tensors`: the arrays by name.
    - `use`: the settings that they need, such as the size of the grid.
    - `card`: the recipe and the scores, as they are in the file.
    """

    tensors: Tensors
    use: Use = field(default_factory=Use)
    card: Mapping[str, Any] = field(default_factory=dict)


def read_weights(path: Path) -> Weights:
    """Read a file of weights, this project's or the toolkit's. Raises `Rejected` and `OSError`."""
    with path.open("rb") as file:
        data = file.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise reject("bad-weights", f"The file is larger than {MAX_BYTES:,} bytes.", path.name)
    with open_archive(data) as archive:
        is_own = CARD in archive.namelist()
        weights = _read_own(archive) if is_own else Weights(read_checkpoint(archive, expected=SHAPES))
    findings = Findings()
    for name, values in weights.tensors.items():
        if not np.isfinite(values).all():
            findings.add("bad-weights", f"The tensor {name} has NaN or infinity; expected finite numbers.")
        elif name.endswith("running_var") and values.min() < 0:
            findings.add("bad-weights", f"The tensor {name} has a negative variance.")
    findings.raise_if_any()
    return weights


def write_weights(path: Path, weights: Weights) -> None:
    """Write weights to a file of this project's own form. The same weights give the same bytes."""
    card = {**weights.card, "use": asdict(weights.use)}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        _add(archive, CARD, (json.dumps(card, indent=1, ensure_ascii=False) + "\n").encode())
        for name in SHAPES:
            buffer = io.BytesIO()
            np.lib.format.write_array(
                buffer, np.ascontiguousarray(weights.tensors[name], dtype="<f4"), version=(1, 0)
            )
            _add(archive, f"{name}.npy", buffer.getvalue())


def _add(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
    entry.compress_type = zipfile.ZIP_DEFLATED
    archive.writestr(entry, data)


def _read_own(archive: zipfile.ZipFile) -> Weights:
    card = _read_card(archive)
    findings, tensors = Findings(), {}
    for name, shape in SHAPES.items():
        entry = archive.NameToInfo.get(f"{name}.npy")
        n_bytes = _HEADER_BYTES + 4 * prod(shape)
        if entry is None:
            findings.add("bad-weights", f"The file has no tensor {name}; expected one of {shape}.")
        elif entry.file_size != n_bytes:
            message = (
                f"The tensor {name} has {entry.file_size:,} bytes; expected {n_bytes:,}, {shape} float32."
            )
            findings.add("bad-weights", message)
        elif (values := _array(read_entry(archive, entry.filename, n_bytes=n_bytes), shape)) is None:
            findings.add("bad-weights", f"The tensor {name} is not an array {shape} of float32.")
        else:
            tensors[name] = values
    findings.raise_if_any()
    return Weights(tensors, _read_use(card.pop("use", None)), card)


def _array(data: bytes, shape: Shape) -> NDArray[np.float32] | None:
    """Read an `.npy` file with exactly this header, else None."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": "<f4", "fortran_order": False, "shape": shape})
    header = buffer.getvalue()
    if not data.startswith(header) or len(header) != _HEADER_BYTES:
        return None
    return np.frombuffer(data, dtype="<f4", offset=_HEADER_BYTES).reshape(shape).astype(np.float32)


def _read_card(archive: zipfile.ZipFile) -> dict[str, Any]:
    entry = archive.getinfo(CARD)
    try:
        card = json.loads(read_entry(archive, CARD, n_bytes=min(entry.file_size, 2**20)))
    except (ValueError, RecursionError):
        card = None
    if not isinstance(card, dict):
        raise reject("bad-weights", f"{CARD} is not a JSON object.")
    return card


def _read_use(entry: object) -> Use:
    # Cards that were written before there was a choice have no decoding.
    known = {each.name for each in fields(Use)}
    if isinstance(entry, dict) and known - {"decoding"} <= entry.keys() <= known:
        use = Use(**entry)
        numbers = (use.n_cells, use.max_box_px, use.margin_px)
        if (
            use.similarity in ("dot", "cosine")
            and use.decoding in DECODINGS
            and type(use.n_cells) is int
            and all(type(number) in (int, float) for number in numbers)
            and 1 <= use.n_cells <= 100
            and 8 <= use.max_box_px <= 400
            and 0 <= use.margin_px <= 64
        ):
            return use
    raise reject("bad-weights", f'"use" in {CARD} says nothing that this version can do: {str(entry)[:200]}.')
