"""The toolkit's checkpoint, a zip of a pickle and raw tensors, read without torch or running it."""

# The pickle may name an ordered dict, torch's function that rebuilds a tensor, and two kinds of storage;
# stand-ins only take notes. Sizes are checked before anything is read, and tensors before their bytes are.

from __future__ import annotations

import io
import pickle
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from evaluator.problems import Findings, Rejected, quoted, reject

MAX_BYTES: Final = 64 * 2**20
"""Of a checkpoint, and of what is unpacked from it; the toolkit's has 0.7 MB."""

MAX_PICKLE_BYTES: Final = 2**20
MAX_ENTRIES: Final = 4096

_ITEM_BYTES: Final = {"FloatStorage": 4, "LongStorage": 8}
Shape = tuple[int, ...]


def read_entry(archive: zipfile.ZipFile, name: str, *, n_bytes: int) -> bytes:
    """Read an entry of exactly `n_bytes`; raises `Rejected`."""
    try:
        with archive.open(name) as file:
            data = file.read(n_bytes + 1)
    except (zipfile.BadZipFile, EOFError, OSError, RuntimeError, NotImplementedError, ValueError) as error:
        raise reject("bad-weights", f"The entry {quoted(name)} cannot be read ({error}).") from None
    if len(data) != n_bytes:
        size = f"more than {n_bytes:,}" if len(data) > n_bytes else f"{len(data):,}"
        message = f"The entry {quoted(name)} has {size} bytes; expected {n_bytes:,}."
        raise reject("bad-weights", message)
    return data


def open_archive(data: bytes) -> zipfile.ZipFile:
    """Open a zip in `data` without unpacking; raises `Rejected` for other or too large files."""
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
    except (zipfile.BadZipFile, ValueError, OverflowError, EOFError, NotImplementedError):
        message = "The file is not a complete zip; expected this project's weights or a torch checkpoint."
        raise reject("bad-weights", message) from None
    entries = archive.infolist()
    n_bytes = sum(entry.file_size for entry in entries)
    if len(entries) > MAX_ENTRIES or n_bytes > MAX_BYTES:
        message = (
            f"The file unpacks to {len(entries):,} entries of {n_bytes:,} bytes in all; "
            f"expected at most {MAX_ENTRIES:,} and {MAX_BYTES:,}."
        )
        raise reject("bad-weights", message)
    return archive


def read_checkpoint(
    archive: zipfile.ZipFile, *, expected: Mapping[str, Shape]
) -> dict[str, NDArray[np.float32]]:
    """Read the tensors under "model", exactly the `expected` ones; raises `Rejected` with every fault."""
    # Counters of batches are accepted and unused.
    [pickled] = [name for name in archive.namelist() if name.endswith("/data.pkl")] or [""]
    if not pickled:
        raise reject("bad-weights", "The zip has no data.pkl; expected a checkpoint of torch 1.6 or later.")
    root = pickled.removesuffix("data.pkl")
    noted = _model(_unpickled(archive, pickled))
    findings = Findings()
    for name, shape in expected.items():
        if name not in noted:
            findings.add("bad-weights", f"The checkpoint has no tensor {name}; expected one of {shape}.")
        elif fault := noted[name].fault(shape):
            findings.add("bad-weights", f"The tensor {name} {fault}.")
    for name in noted:
        if name not in expected and not name.endswith(".num_batches_tracked"):
            findings.add("bad-weights", f"The network has no tensor {quoted(name)}.")
    findings.raise_if_any()
    return {name: noted[name].values(archive, root=root) for name in expected}


def _unpickled(archive: zipfile.ZipFile, name: str) -> object:
    n_bytes = archive.getinfo(name).file_size
    if n_bytes > MAX_PICKLE_BYTES:
        message = f"The checkpoint's data.pkl has {n_bytes:,} bytes; expected at most {MAX_PICKLE_BYTES:,}."
        raise reject("bad-weights", message)
    data = read_entry(archive, name, n_bytes=n_bytes)
    try:
        return _Unpickler(io.BytesIO(data)).load()
    except Rejected:
        raise
    except Exception as error:  # noqa: BLE001 -- "including, but not necessarily limited to", says the manual
        fault = str(error)[:200]
        message = f"The checkpoint's data.pkl is not an intact pickle of tensors ({fault})."
        raise reject("bad-weights", message) from None


def _model(checkpoint: object) -> dict[str, _Tensor]:
    model = checkpoint.get("model") if isinstance(checkpoint, dict) else None
    if not isinstance(model, dict) or not all(
        isinstance(name, str) and isinstance(tensor, _Tensor) for name, tensor in model.items()
    ):
        message = 'The checkpoint has no "model" with named tensors; expected one that the toolkit has saved.'
        raise reject("bad-weights", message)
    return model


@dataclass(frozen=True, slots=True)
class _Storage:
    kind: str
    key: str
    n_items: int


@dataclass(frozen=True, slots=True)
class _Tensor:
    """An untrusted tensor of the pickle until `fault` has checked it."""

    storage: Any
    offset: Any
    shape: Any
    stride: Any

    def fault(self, expected: Shape) -> str | None:
        """Explain why it lacks this shape or is not contiguous, else None."""
        if self.shape != expected:
            return f"has the shape {self.shape}; expected {expected}"
        if not isinstance(self.storage, _Storage) or self.storage.kind != "FloatStorage":
            return "does not hold numbers of float32"
        if self.stride != tuple(prod(expected[axis + 1 :]) for axis in range(len(expected))):
            return f"lies in steps of {self.stride}; expected rows that follow each other"
        if type(self.offset) is not int or not 0 <= self.offset <= self.storage.n_items - prod(expected):
            return f"begins at {self.offset} of {self.storage.n_items} numbers, and ends beyond them"
        return None

    def values(self, archive: zipfile.ZipFile, *, root: str) -> NDArray[np.float32]:
        """Return its numbers, all finite; call `fault` first."""
        name = f"{root}data/{self.storage.key}"
        if name not in archive.NameToInfo:
            raise reject("bad-weights", f"The zip has no entry {quoted(name)}, which a tensor refers to.")
        data = read_entry(archive, name, n_bytes=self.storage.n_items * _ITEM_BYTES[self.storage.kind])
        values = np.frombuffer(data, dtype="<f4", count=prod(self.shape), offset=4 * self.offset)
        return values.reshape(self.shape).astype(np.float32)


class _Notes(dict[Any, Any]):
    def __setstate__(self, state: object) -> None:
        pass


class _Answer:
    """A stand-in for a name of the pickle, without mutable state."""

    __slots__ = ("name",)

    def __init__(self, name: str) -> None:
        self.name = name

    def __call__(self, *arguments: Any) -> object:
        if self.name == "OrderedDict" and not arguments:
            return _Notes()
        if self.name == "_rebuild_tensor_v2" and len(arguments) >= 4:
            return _Tensor(*arguments[:4])
        raise pickle.UnpicklingError(f"{self.name} is called in an unknown way")

    def __setstate__(self, state: object) -> None:
        raise pickle.UnpicklingError(f"{self.name} is given a state")


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> object:
        if f"{module}.{name}" not in GLOBALS:
            message = (
                f"The checkpoint names {quoted(f'{module}.{name}')}; expected only {', '.join(GLOBALS)}. "
                "Nothing of it was run."
            )
            raise reject("forbidden-pickle", message)
        return _Answer(name)

    def persistent_load(self, pid: object) -> _Storage:
        match pid:
            case ("storage", _Answer(name=kind), str(key), str(), int(n_items)):
                if kind in _ITEM_BYTES and key.isdecimal() and 0 <= n_items <= MAX_BYTES:
                    return _Storage(kind, key, n_items)
        raise pickle.UnpicklingError("a storage is described in an unknown way")


GLOBALS: Final = (
    "collections.OrderedDict",
    "torch._utils._rebuild_tensor_v2",
    "torch.FloatStorage",
    "torch.LongStorage",
)
"""All that the pickle of a checkpoint may name."""
