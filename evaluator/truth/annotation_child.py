"""The child process that reads annotation files: `python -m evaluator.truth.annotation_child`.

It gives up its rights and writes `READY`. Each file on standard input, a line of JSON (`name`, `n_bytes`) and
its content, gets an empty line. At the end it writes all sequences, or the problems of the first faulty file,
as a line of JSON.
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict
from typing import IO

from evaluator.limits import EXIT_OUT_OF_MEMORY, READY, forbid_calls, limit, obey_the_parent_alone
from evaluator.problems import Rejected
from evaluator.truth.annotations import read_files


def files_of(source: IO[bytes], answers: IO[bytes]) -> Iterator[tuple[str, bytes]]:
    """Yield the files; each is answered when the next is asked for."""
    while line := source.readline():
        header = json.loads(line)
        yield header["name"], source.read(int(header["n_bytes"]))
        answers.write(b"\n")
        answers.flush()


def warm_up() -> None:
    # Late imports: nothing can be opened afterwards.
    try:
        read_files([("", b"cos\nsystem\n.")], with_ttc=True)
    except Rejected as rejected:
        json.dumps(rejected.as_dict())


def main() -> None:
    """Run with memory in bytes, processor time in seconds, and three flags: true times, boxes, all frames."""
    obey_the_parent_alone()
    warm_up()
    with_ttc, with_boxes, with_frames = (argument == "1" for argument in sys.argv[3:6])
    limit(memory_bytes=int(sys.argv[1]), cpu_s=int(sys.argv[2]))
    forbid_calls()
    answers = sys.stdout.buffer
    answers.write(READY)
    answers.flush()
    try:
        files = files_of(sys.stdin.buffer, answers)
        annotated = read_files(files, with_ttc=with_ttc, with_boxes=with_boxes, with_frames=with_frames)
        table, counts = asdict(annotated.table), annotated.n_sequences
        answer = {
            "table": table,
            "n_sequences": counts,
            "boxes": annotated.boxes,
            "frames": annotated.frame_ttc_s,
        }
        line = json.dumps(answer).encode()
    except Rejected as rejected:
        line = json.dumps(rejected.as_dict()).encode()
    except MemoryError:
        sys.exit(EXIT_OUT_OF_MEMORY)
    answers.write(line + b"\n")
    answers.flush()


if __name__ == "__main__":
    main()
