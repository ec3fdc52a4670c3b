"""Folders of annotation files: their order and their sequences.

anno_ids count from 0 over the files **sorted by path**; the toolkit takes the file system's order, which
differs between machines.
"""

# On Linux a child process with little memory and time reads the pickles (`annotation_child`), and its answer
# is checked like the files. Elsewhere they are read here, without limits: no pickle runs code, but a
# malicious one may exhaust memory or never end.

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import NoneType
from typing import Any, Final

from evaluator.hidden_files import is_hidden
from evaluator.problems import Rejected, reject
from evaluator.truth.annotations import AnnotatedFiles, read_files
from evaluator.truth.csv_tables import Table

MAX_FILE_BYTES: Final = 128 * 1024 * 1024
"""The largest annotation file that is read, far above that of a recording of minutes."""

HAS_LIMITS: Final = sys.platform == "linux" and bool(sys.executable)
"""Whether a child process can be given less than its parent has."""

_BASE_BYTES: Final = 512 * 1024 * 1024
_BYTES_PER_BYTE: Final = 32
_BASE_CPU_S: Final = 3
_BYTES_PER_CPU_S: Final = 2_000_000
"""A sixth of what a slow core reads."""
_EXTENSION: Final = ".pkl"
_KINDS: Final[dict[str, tuple[type, ...]]] = {
    "anno_id": (int,),
    "bag_stamp": (str,),
    "cam_id": (str,),
    "ts_ns": (int,),
    "track_id": (str,),
    "ttc_s": (float,),
    "locations": (int, str),
    "occ_ratio": (float, NoneType),
    "same_lane": (bool, NoneType),
    "box2d": (list, NoneType),
}
"""What the columns of the child's table hold."""
_MAX_COMPLAINT_BYTES: Final = 64 * 1024
_EXIT_TIMEOUT_S: Final = 10.0
_EXPECTED: Final = "expected annotations of the toolkit"


def read_annotations(
    folder: Path, *, with_ttc: bool, with_boxes: bool = False, with_frames: bool = False
) -> AnnotatedFiles:
    """Read the sequences of every `*.pkl` below `folder`, one row each, from its target frame.

    `with_ttc` requires `ttc_imu` in targets (the public test set lacks it); `with_boxes` and `with_frames`
    read the boxes and times of all frames. Raises `Rejected` for a folder without such files and for
    unreadable, malicious or malformed files.
    """
    listed = list_files(folder)
    if not listed:
        raise reject(
            "unreadable", "The folder has no annotation files; expected at least one *.pkl.", folder.name
        )
    files = sorted(listed, key=lambda path: path.relative_to(folder).parts)
    position = {path: index for index, path in enumerate(files)}
    read = _read_apart if HAS_LIMITS else _read_here
    annotated = read(folder, files, with_ttc=with_ttc, with_boxes=with_boxes, with_frames=with_frames)
    return replace(annotated, listed=[position[path] for path in listed])


def list_files(folder: Path) -> list[Path]:
    """List the annotation files below `folder` in the order of the toolkit on this machine."""

    def cannot_list(error: OSError) -> None:
        where = Path(error.filename).name if error.filename else folder.name
        raise reject("unreadable", f"The folder cannot be listed: {error.strerror}.", where) from None

    paths = [
        Path(directory, name)
        for directory, _folders, names in os.walk(folder, onerror=cannot_list)
        for name in names
        if os.path.splitext(name)[1] == _EXTENSION  # noqa: PTH122 -- the toolkit's own question
    ]
    # Of hidden files, the toolkit reads none that is an annotation file.
    return [path for path in paths if path.is_file() and not is_hidden(path.relative_to(folder))]


def _contents(folder: Path, files: Sequence[Path]) -> Iterator[tuple[str, bytes]]:
    for path in files:
        name = path.relative_to(folder).as_posix()
        try:
            size = path.stat().st_size
            data = path.read_bytes() if size <= MAX_FILE_BYTES else b""
        except OSError as error:
            raise reject("unreadable", f"The file cannot be read: {error.strerror}.", name) from None
        if size > MAX_FILE_BYTES:
            message = f"The file has {size:,} bytes; expected at most {MAX_FILE_BYTES:,}."
            raise reject("too-large", message, name)
        yield name, data


def _read_here(
    folder: Path, files: Sequence[Path], *, with_ttc: bool, with_boxes: bool, with_frames: bool
) -> AnnotatedFiles:
    try:
        contents = _contents(folder, files)
        return read_files(contents, with_ttc=with_ttc, with_boxes=with_boxes, with_frames=with_frames)
    except MemoryError:
        message = "Reading the files needs more memory than there is; expected annotations of the toolkit."
        raise reject("too-large", message, folder.name) from None


# --- the child's parent ----------------------------------------------------------------------------------


def _read_apart(
    folder: Path, files: Sequence[Path], *, with_ttc: bool, with_boxes: bool, with_frames: bool
) -> AnnotatedFiles:
    sizes = [min(path.stat().st_size, MAX_FILE_BYTES) for path in files]
    memory_bytes = _BASE_BYTES + _BYTES_PER_BYTE * max(sizes)
    cpu_s = _BASE_CPU_S + sum(sizes) // _BYTES_PER_CPU_S
    command = [
        sys.executable,
        "-P",
        "-m",
        "evaluator.truth.annotation_child",
        *map(str, (memory_bytes, cpu_s, int(with_ttc), int(with_boxes), int(with_frames))),
    ]
    environment = {
        "PATH": os.defpath,
        "PYTHONPATH": os.pathsep.join([str(Path(__file__).resolve().parents[2]), *filter(None, sys.path)]),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    try:
        child = subprocess.Popen(  # noqa: S603 - our own interpreter and module, nothing of the files
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=environment,
        )
    except OSError as error:
        raise _not_started(folder, error.strerror or str(error)) from None
    with child:
        try:
            return _asked(child, folder, files, memory_bytes=memory_bytes)
        finally:
            child.kill()  # it has answered, or never will


def _asked(
    child: subprocess.Popen[bytes], folder: Path, files: Sequence[Path], *, memory_bytes: int
) -> AnnotatedFiles:
    from evaluator.limits import READY  # noqa: PLC0415 -- nothing of it is on Windows

    asking, answering = child.stdin, child.stdout
    assert asking is not None  # noqa: S101 - both are pipes
    assert answering is not None  # noqa: S101 - the same
    if answering.readline(len(READY)) != READY:
        raise _not_started(folder, _last_words(child))
    for name, data in _contents(folder, files):
        try:
            asking.write(json.dumps({"name": name, "n_bytes": len(data)}).encode() + b"\n")
            asking.write(data)
            asking.flush()
        except BrokenPipeError:
            pass  # it died of this file, or has refused it: the next line says which
        line = answering.readline(memory_bytes)
        if not line:
            raise reject(*_end_of(child, memory_bytes=memory_bytes), name)
        if line.strip():
            return _decoded(line, name)
    asking.close()
    line = answering.readline(memory_bytes)
    if not line:
        raise reject(*_end_of(child, memory_bytes=memory_bytes), folder.name)
    return _decoded(line, folder.name)


def _not_started(folder: Path, cause: str) -> Rejected:
    return reject("unreadable", f"The process that reads the files did not start: {cause}.", folder.name)


def _last_words(child: subprocess.Popen[bytes]) -> str:
    complaint = child.stderr.read(_MAX_COMPLAINT_BYTES) if child.stderr else b""
    with suppress(BrokenPipeError):  # for what it has not read
        if child.stdin:
            child.stdin.close()
    try:
        child.wait(timeout=_EXIT_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        child.kill()  # it has closed its answer, and goes on
        child.wait()
    last_line = complaint[-2000:].decode(errors="replace").strip().rpartition("\n")[2]
    return f"exit code {child.returncode}, {last_line[:200]}"


def _end_of(child: subprocess.Popen[bytes], *, memory_bytes: int) -> tuple[str, str]:
    import signal  # noqa: PLC0415 -- as READY

    from evaluator.limits import EXIT_OUT_OF_MEMORY  # noqa: PLC0415 -- as READY

    last_words = _last_words(child)
    if child.returncode == EXIT_OUT_OF_MEMORY:
        return "too-large", f"Reading the file needs more than {memory_bytes >> 20:,} MiB; {_EXPECTED}."
    if child.returncode == -signal.SIGXCPU:
        return "too-large", f"Reading the file takes too long for the size of the files; {_EXPECTED}."
    if child.returncode < 0:
        message = f"Reading the file ended its process with signal {-child.returncode}; {_EXPECTED}."
        return "bad-annotations", message
    return "bad-annotations", f"Reading the file failed ({last_words}); {_EXPECTED}."


def _decoded(line: bytes, where: str) -> AnnotatedFiles:
    try:
        answer: dict[str, Any] = json.loads(line)
        if "problems" in answer:
            raise Rejected.from_dict(answer)
        table, counts = _table(answer["table"]), answer["n_sequences"]
        if sum(counts) != len(table.anno_id):
            raise ValueError("the files have another number of sequences than the table")
        return AnnotatedFiles(table, counts, boxes=answer["boxes"], frame_ttc_s=answer["frames"])
    except (ValueError, TypeError, LookupError, RecursionError):
        message = f"Reading the file gave an answer of another form; {_EXPECTED}."
        raise reject("bad-annotations", message, where) from None


def _table(columns: dict[str, Any]) -> Table:
    table = Table(**columns)
    for name, kinds in _KINDS.items():
        column = getattr(table, name)
        if len(column) not in {0, len(table.anno_id)} or not all(type(value) in kinds for value in column):
            raise ValueError(f"{name} is no column of the table")
    return table
