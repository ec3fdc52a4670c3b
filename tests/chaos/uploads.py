"""Prediction files with what must come of them, and clients that send them until they are acknowledged."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import httpx2
import numpy as np

import evaluator
from evaluator import Rejected, rounded
from evaluator.limits import READY
from leaderboard.sandbox.fork_server import environment
from tests.chaos.processes import REPOSITORY

BOMB_ENTRIES = 3_150_000
ROOM_BYTES = 12_000_000  # for reading a file: much for the good ones here, less than a bomb's bytes
RETRY_S = 0.5


@dataclass(frozen=True)
class Upload:
    """One file, and the result that the evaluator gives for its bytes, here and now, without any server."""

    name: str
    data: bytes
    state: str
    scores: dict[str, float | None] | None = None
    problems: tuple[str, ...] = ()


@dataclass
class Receipt:
    """What a client knows after its upload was acknowledged."""

    upload: Upload
    submission_id: str
    n_tries: int
    was_known: bool


def make_uploads(truth: evaluator.GroundTruth, *, n: int, n_bombs: int, seed: int) -> list[Upload]:
    """`n` different files in random order: most good, every tenth faulty, `n_bombs` kill their reader."""
    rng = np.random.default_rng(seed)
    uploads = []
    for i in range(n):
        if i < n_bombs:
            uploads.append(Upload(name=f"bomb-{i}", data=bomb_file(i), state="SYSTEM_ERROR"))
            continue
        ttc_s = truth.ttc_s * np.exp(rng.normal(0.0, 0.2, truth.n_sequences))
        data = evaluator.write_predictions(manifest=truth.manifest, ttc_s=ttc_s)
        data = _faulty(data, kind=i // 10 % 4) if i % 10 == 9 else data
        uploads.append(_with_expectation(f"file-{i}", data, truth))
    return [uploads[i] for i in rng.permutation(n)]


def _with_expectation(name: str, data: bytes, truth: evaluator.GroundTruth) -> Upload:
    try:
        report = evaluator.evaluate(evaluator.read_predictions(data, manifest=truth.manifest), truth)
    except Rejected as rejected:
        codes = tuple(problem.code for problem in rejected.problems)
        return Upload(name=name, data=data, state="REJECTED", problems=codes)
    scores = {metric: rounded(value, decimals=1) for metric, value in report.flat().items()}
    return Upload(name=name, data=data, state="SCORED", scores=scores)


def _faulty(good: bytes, *, kind: int) -> bytes:
    values = json.loads(good)
    first = next(iter(values))
    if kind == 0:
        del values[first]
    elif kind == 1:
        values[first] = float("nan")
    elif kind == 2:
        values[first] = "soon"
    text = json.dumps(values)
    return text[: len(text) // 2].encode() if kind == 3 else text.encode()


def bomb_file(number: int) -> bytes:
    """Just below the size limit, and alone with its bytes more than the reader has room for."""
    return b'{"0":%d' % number + b',"0":1' * BOMB_ENTRIES + b"}"


def reader_memory_bytes(truth: evaluator.GroundTruth, *, directory: Path) -> int:
    """What the process that reads a file has in hand before it begins, and a little room.

    Measured, since it hangs on the versions of the libraries.
    """
    path = directory / "manifest.npz"
    truth.manifest.save(path)
    command = [sys.executable, "-m", "evaluator.predictions.reader", str(path), "4000000000", "60"]
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        # With threads of its own, which the reader does not have, it would be larger than the reader.
        env=environment(python_path=REPOSITORY),
    ) as reader:
        assert reader.stdout is not None
        if reader.stdout.readline() != READY:
            raise RuntimeError("the process that reads files does not start")
        status = Path(f"/proc/{reader.pid}/status").read_text().splitlines()
        [size_kb] = [int(line.split()[1]) for line in status if line.startswith("VmSize:")]
        reader.kill()
    return size_kb * 1024 + ROOM_BYTES


@dataclass
class Clients:
    """People with scripts: each sends its files at its pace, again and again until one is acknowledged."""

    url: str
    token: str
    split: str
    receipts: list[Receipt] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    n_failed_tries: int = 0

    def start(self, uploads: Sequence[Upload], *, n_clients: int, seconds: float) -> list[threading.Thread]:
        """Send everything over about `seconds`. Returns the clients, to be joined."""
        pace_s = seconds * n_clients / max(len(uploads), 1)
        threads = [
            threading.Thread(target=self._send_all, args=(uploads[i::n_clients], pace_s), name=f"client-{i}")
            for i in range(n_clients)
        ]
        for thread in threads:
            thread.start()
        return threads

    def _send_all(self, uploads: Sequence[Upload], pace_s: float) -> None:
        due_s = time.monotonic()
        with httpx2.Client(
            base_url=self.url,
            headers={"Authorization": f"Bearer {self.token}"},
            timeout=60,
            trust_env=False,
        ) as http:
            for upload in uploads:
                time.sleep(max(0.0, due_s - time.monotonic()))
                due_s += pace_s
                self._send(http, upload)

    def _send(self, http: httpx2.Client, upload: Upload) -> None:
        """Until it is acknowledged: that is what the API's documentation tells clients to do."""
        n_tries = 0
        while True:
            n_tries += 1
            try:
                answer = http.post(
                    "/api/v1/submissions",
                    data={"split": self.split, "method": upload.name},
                    files={"file": (f"{upload.name}.json", upload.data, "application/json")},
                )
            except httpx2.TransportError:
                answer = None
            if answer is not None and answer.status_code in (200, 201):
                self.receipts.append(
                    Receipt(upload, str(answer.json()["id"]), n_tries, was_known=answer.status_code == 200)
                )
                return
            if answer is not None and answer.status_code not in (502, 503, 504, 507):
                self.refused.append(f"{upload.name}: {answer.status_code} {answer.text[:300]}")
                return
            self.n_failed_tries += 1
            time.sleep(RETRY_S)
