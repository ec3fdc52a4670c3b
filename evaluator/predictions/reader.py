"""The child process that parses untrusted bytes: `python -m evaluator.predictions.reader`.

It gives up its rights (`evaluator.limits`), writes `READY`, reads a prediction file from standard input, and
writes a line of JSON and, for a good file, the aligned seconds as little-endian float64.
"""

import json
import sys
from pathlib import Path

import numpy as np

from evaluator.limits import EXIT_OUT_OF_MEMORY, READY, forbid_calls, limit, obey_the_parent_alone
from evaluator.predictions.loading import read_sent
from evaluator.problems import Rejected
from evaluator.truth.ground_truth import Manifest


def warm_up(manifest: Manifest) -> None:
    # Late imports and the manifest's keys: nothing can be opened afterwards.
    _ = manifest.row_of_id, manifest.row_of_natural_key
    for sample in (
        b"{",
        b"[]",
        b'{"a":NaN}',
        b'{"a":1,"a":1}',
        b'{"unit":"scale_ratio"}',
        b"\xff",
        b'{"a":"b"}',
        b"\x1f\x8b",
        b"PAR1",
        b"anno_id,ttc\n\xff",
        b"anno_id,ttc\n0,x\n",
    ):
        try:
            read_sent(sample, manifest=manifest)
        except Rejected:
            continue


def answer(data: bytes, *, manifest: Manifest) -> bytes:
    try:
        predictions = read_sent(data, manifest=manifest)
    except Rejected as rejected:
        return json.dumps({"verdict": "rejected", **rejected.as_dict()}).encode() + b"\n"
    header = {
        "verdict": "good",
        "digest": predictions.digest,
        "unit": predictions.unit,
        "keys": predictions.keys,
        "enveloped": predictions.enveloped,
    }
    values = np.ascontiguousarray(predictions.ttc_s, dtype="<f8").tobytes()
    return json.dumps(header).encode() + b"\n" + values


def main() -> None:
    """Run with the arguments: manifest file, memory limit in bytes, processor time in seconds."""
    obey_the_parent_alone()
    manifest = Manifest.load(Path(sys.argv[1]))
    warm_up(manifest)
    limit(memory_bytes=int(sys.argv[2]), cpu_s=int(sys.argv[3]))
    forbid_calls()
    out = sys.stdout.buffer
    out.write(READY)
    out.flush()
    try:
        reply = answer(sys.stdin.buffer.read(), manifest=manifest)
    except MemoryError:
        sys.exit(EXIT_OUT_OF_MEMORY)
    out.write(reply)
    out.flush()


if __name__ == "__main__":
    main()
