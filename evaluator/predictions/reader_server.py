"""The process that forks a reader for each prediction file: `python -m evaluator.predictions.reader_server`.

Standard input is a socket of packets. A request is JSON (`manifest`, `memory_bytes`, `cpu_s`) with three
descriptors: the file, and the pipes for output and errors. The replies are `{"started": pid}` with a
descriptor of the child, or `{"failed": reason}`; then `{"returncode": n}`, negative for a signal.
"""

# A fork reads 28,600 sequences in 0.02 s, a new Python, which loads numpy, in 0.44 s. The server itself has
# no credentials and reads no untrusted byte; it handles one file at a time.

import gc
import json
import os
import resource
import socket
import traceback
from functools import lru_cache
from pathlib import Path
from typing import Final, NoReturn

from evaluator.limits import (
    EXIT_OUT_OF_MEMORY,
    READY,
    forbid_calls,
    keep_memory_private,
    limit,
    obey_the_parent_alone,
)
from evaluator.predictions.reader import answer, warm_up
from evaluator.problems import Rejected
from evaluator.truth.ground_truth import Manifest

MAX_PACKET_BYTES: Final = 65_536
N_DESCRIPTORS: Final = 3
"""Of a request: the file, the output, the errors. They become the child's descriptors 0, 1 and 2."""


def _manifest(path: str) -> Manifest:
    status = Path(path).stat()
    return _loaded(path, status.st_ino, status.st_mtime_ns)


@lru_cache(maxsize=4)
def _loaded(path: str, _inode: int, _mtime_ns: int) -> Manifest:
    manifest = Manifest.load(Path(path))
    # What a manifest computes when it is first needed, children then share.
    warm_up(manifest)
    gc.freeze()
    return manifest


def serve(connection: socket.socket) -> None:
    while True:
        packet, descriptors, _, _ = socket.recv_fds(connection, MAX_PACKET_BYTES, N_DESCRIPTORS)
        if not packet:
            return
        try:
            _serve_one(connection, json.loads(packet), descriptors)
        finally:
            for descriptor in descriptors:
                os.close(descriptor)


def _serve_one(connection: socket.socket, request: dict[str, object], descriptors: list[int]) -> None:
    server = os.getpid()
    try:
        manifest = _manifest(str(request["manifest"]))
        child = os.fork()
    except (OSError, Rejected, MemoryError) as fault:
        _send(connection, {"failed": f"{type(fault).__name__}: {fault}"[:500]})
        return
    if child == 0:
        _read(
            descriptors,
            manifest=manifest,
            server=server,
            memory_bytes=int(str(request["memory_bytes"])),
            cpu_s=int(str(request["cpu_s"])),
        )
    process = os.pidfd_open(child)
    try:
        socket.send_fds(connection, [json.dumps({"started": child}).encode()], [process])
    finally:
        os.close(process)
    # The child's end of each pipe is closed here, so that its reader sees the end when the child ends.
    while descriptors:
        os.close(descriptors.pop())
    _, status = os.waitpid(child, 0)
    _send(connection, {"returncode": os.waitstatus_to_exitcode(status)})


def _send(connection: socket.socket, reply: dict[str, object]) -> None:
    connection.sendall(json.dumps(reply).encode())


def _read(
    descriptors: list[int], *, manifest: Manifest, server: int, memory_bytes: int, cpu_s: int
) -> NoReturn:
    code = 1
    try:
        for number, descriptor in enumerate(descriptors):
            os.dup2(descriptor, number)
        os.closerange(N_DESCRIPTORS, resource.getrlimit(resource.RLIMIT_NOFILE)[0])
        # The wish to end with the parent is not inherited, and comes too late for one that has ended by now.
        obey_the_parent_alone()
        if os.getppid() == server:
            code = _answer(manifest, memory_bytes=memory_bytes, cpu_s=cpu_s)
    except MemoryError:
        code = EXIT_OUT_OF_MEMORY
    except BaseException:  # noqa: BLE001 - whatever it is, the child must not go on as a second server
        traceback.print_exc()
    finally:
        os._exit(code)


def _answer(manifest: Manifest, *, memory_bytes: int, cpu_s: int) -> int:
    with os.fdopen(0, "rb", closefd=False) as source, os.fdopen(1, "wb", closefd=False) as out:
        limit(memory_bytes=memory_bytes, cpu_s=cpu_s)
        forbid_calls()
        out.write(READY)
        out.flush()
        out.write(answer(source.read(), manifest=manifest))
    return 0


def main() -> None:
    obey_the_parent_alone()
    keep_memory_private()
    # What a library of the worker has opened without care is none of a reader's business.
    os.closerange(N_DESCRIPTORS, resource.getrlimit(resource.RLIMIT_NOFILE)[0])
    gc.freeze()
    with socket.socket(fileno=0) as connection:
        serve(connection)


if __name__ == "__main__":
    main()
