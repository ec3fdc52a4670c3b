"""The child process in which untrusted bytes are parsed: `python -m evaluator.quarantine`.

It reads a prediction file from its standard input and writes to its standard output one line of JSON,
followed, if the file is good, by the aligned values in seconds as little-endian float64. Before the first
untrusted byte is read it gives up memory, processor time, new processes and the right to open anything,
sockets included.
"""

import codecs
import json
import resource
import sys
from pathlib import Path

import msgspec
import numpy as np
import orjson

from evaluator.predictions import read_predictions
from evaluator.problems import Rejected
from evaluator.truth import Manifest


def limit(*, memory_bytes: int, cpu_s: int) -> None:
    """Give up what parsing does not need. Irrevocable for this process."""
    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s + 1))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_NPROC, (0, 0))
    # Standard input, output and error are open already; nothing else ever will be.
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, 3))


def warm_up(manifest: Manifest) -> None:
    """Run every branch that imports late, since nothing can be opened afterwards."""
    for sample in (
        b"{",
        b"[]",
        b'{"a":NaN}',
        b'{"a":1,"a":1}',
        b'{"unit":"scale_ratio"}',
        b"\xff",
        b'{"a":"b"}',
    ):
        try:
            read_predictions(sample, manifest=manifest)
        except Rejected:
            continue
    for library in (codecs, msgspec, orjson):
        if library.__name__ not in sys.modules:
            raise RuntimeError(f"{library.__name__} is not loaded")


def main() -> None:
    """Arguments: manifest file, memory limit in bytes, processor time in seconds."""
    manifest = Manifest.load(Path(sys.argv[1]))
    warm_up(manifest)
    limit(memory_bytes=int(sys.argv[2]), cpu_s=int(sys.argv[3]))
    try:
        predictions = read_predictions(sys.stdin.buffer.read(), manifest=manifest)
    except Rejected as rejected:
        problems = [{"code": p.code, "message": p.message, "where": p.where} for p in rejected.problems]
        header = {"verdict": "rejected", "problems": problems, "n_problems": rejected.n_problems}
        body = b""
    else:
        header = {
            "verdict": "good",
            "digest": predictions.digest,
            "unit": predictions.unit,
            "keys": predictions.keys,
            "enveloped": predictions.enveloped,
        }
        body = np.ascontiguousarray(predictions.ttc_s, dtype="<f8").tobytes()
    sys.stdout.buffer.write(json.dumps(header).encode() + b"\n" + body)
    sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
