"""A baseline over a folder: a complete prediction file with a value for every sequence.

    folder = read_folder(Path("val"))
    run_method(folder=folder, method=get_method("detection"), parameters={}, frame_gap=5, out=Path("p.json"))

With several processes, a script needs its `if __name__ == "__main__":`.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from evaluator.counting import counted
from evaluator.predictions.writing import write_predictions
from evaluator.problems import Findings, Problem, reject
from evaluator.truth.ground_truth import KeyKind
from tsttc_baselines.folder_checks import require_complete, require_usable
from tsttc_baselines.folders import SequenceFolder
from tsttc_baselines.journals import Journal
from tsttc_baselines.methods import Method, Value
from tsttc_baselines.outcomes import Outcome, SequenceEstimator
from tsttc_baselines.own_methods import code_of, is_own
from tsttc_baselines.processes import worked_through

MOST_FALLBACKS: Final = 0.95
"""A run has fewer fallbacks than this share of its sequences."""

MAX_REASONS: Final = 40
"""Reasons that the prediction file counts one by one."""

Progress = Callable[[int], None]
"""Is told, at least every second, how many sequences have a value."""


@dataclass(frozen=True, eq=False)
class Run:
    """The result of a run.

    - `scale_ratio`: an array of one value for each sequence, in the order of the manifest.
    - `n_fallback`: the number of fallbacks by reason, the most frequent first.
    - `examples`: one problem for each reason.
    - `n_resumed`: the number of values that come from an interrupted run.
    - `seconds`: the duration of the run; that of an interrupted run is added.
    - `meta`: the field `meta` of the prediction file.
    - `data`: the bytes of the prediction file.
    """

    scale_ratio: NDArray[np.float64]
    n_fallback: dict[str, int]
    examples: dict[str, Problem]
    n_resumed: int
    seconds: float
    meta: dict[str, Any]
    data: bytes


def run_method(
    *,
    folder: SequenceFolder,
    method: Method,
    parameters: Mapping[str, Value],
    frame_gap: int,
    out: Path,
    keys: KeyKind = "natural_key",
    n_processes: int = 1,
    strict: bool = False,
    progress: Progress = lambda _n_done: None,
) -> Run:
    """Estimate every sequence of a folder, and write a prediction file of scale ratios.

    - `folder`: the sequences, from `read_folder`.
    - `method`: the method, from `get_method` or `find_method`.
    - `parameters`: its parameters by name; defaults are filled in.
    - `frame_gap`: the number of frames from the reference to the target, 1 to 5.
    - `out`: the file to write. While the run lasts, its state is in a file beside it that ends in `.part`;
      after an interruption, the same call continues.
    - `keys`: the kind of keys of the file. The dataset's toolkit reads "anno_id" only.
    - `n_processes`: the number of processes.
    - `strict`: if true, a fallback raises `Rejected` and no file is written.
    - `progress`: is called with the number of finished sequences, at least every second.

    Raises `Rejected` if the folder cannot be used or nearly all values are fallbacks. Also raises
    `WorkerEnded`, `OutputInUse`, `OSError`, and what the method raises.
    """
    filled = method.filled(parameters)
    used = {**filled, **getattr(method.estimator(filled), "used", {})}
    require_usable(folder, method=method, frame_gap=frame_gap)
    if strict:
        require_complete(folder, method=method, frame_gap=frame_gap)
    make = partial(SequenceEstimator, folder=folder, method=method, parameters=filled, frame_gap=frame_gap)
    key = _key(folder, method, filled, frame_gap)
    began_s = time.perf_counter()
    with Journal(out.with_name(out.name + ".part"), key=key) as journal:
        outcomes = {outcome.row: outcome for outcome in journal.outcomes}
        n_resumed = len(outcomes)
        progress(n_resumed)
        rows = [row for row in folder.rows_in_time().tolist() if row not in outcomes]
        n_useful = n_processes if method.frames != "none" else 1
        with closing(worked_through(make, rows, n_processes=n_useful)) as pieces:
            for piece in pieces:
                outcomes |= {outcome.row: outcome for outcome in piece}
                seconds = journal.seconds + time.perf_counter() - began_s
                if piece:
                    journal.add(piece, seconds=seconds)
                progress(len(outcomes))
        in_order = [outcomes[row] for row in range(folder.n_sequences)]
        if strict:
            _require_no_fallback(in_order)
        _require_estimates(in_order)
        seconds = journal.seconds + time.perf_counter() - began_s
        done = _done(
            folder, method, used, frame_gap, in_order, keys=keys, n_resumed=n_resumed, seconds=seconds
        )
        _write_whole(out, done.data)
        journal.discard()
    return done


def _done(
    folder: SequenceFolder,
    method: Method,
    parameters: Mapping[str, Value],
    frame_gap: int,
    outcomes: list[Outcome],
    *,
    keys: KeyKind,
    n_resumed: int,
    seconds: float,
) -> Run:
    scale_ratio = np.array([outcome.scale_ratio for outcome in outcomes], dtype=np.float64)
    n_fallback = dict(Counter(outcome.reason for outcome in outcomes if outcome.reason).most_common())
    examples: dict[str, Problem] = {}
    for outcome in outcomes:
        if outcome.reason and outcome.problem:
            examples.setdefault(outcome.reason, outcome.problem)
    weights = _weights(parameters)
    meta = {  # without a duration or date: the same estimates are the same bytes, and so one submission
        "method": method.name,
        "version": tsttc_version(),
        "provenance": method.provenance(parameters, digests=weights.get("weights")),
        "parameters": _plain(parameters),
        "n_fallback": _shortened(n_fallback),
        "opencv": cv2.__version__,
        **weights,
        **_code(method),
    }
    data = write_predictions(
        manifest=folder.manifest, keys=keys, scale_ratio=scale_ratio, frame_gap=frame_gap, meta=meta
    )
    return Run(scale_ratio, n_fallback, examples, n_resumed, seconds, meta, data)


def tsttc_version() -> str:
    try:
        return version("tsttc")
    except PackageNotFoundError:
        return "0"


def _key(folder: SequenceFolder, method: Method, parameters: Mapping[str, Value], frame_gap: int) -> str:
    named = {
        "folder": str(folder.images.resolve()),
        "sequences": folder.digest(),
        "method": method.name,
        "parameters": _plain(parameters),
        **_weights(parameters),
        **_code(method),
        "frame_gap": frame_gap,
        "versions": [tsttc_version(), cv2.__version__, np.__version__],
    }
    return hashlib.sha256(json.dumps(named, sort_keys=True).encode()).hexdigest()


def _plain(parameters: Mapping[str, Value]) -> dict[str, object]:
    # A file by its name alone, because its folder is private.
    return {name: value.name if isinstance(value, Path) else value for name, value in parameters.items()}


def _weights(parameters: Mapping[str, Value]) -> dict[str, dict[str, str]]:
    """Return {"weights": SHA-256 of each file among the parameters}, or {}."""
    files = {name: value for name, value in parameters.items() if isinstance(value, Path)}
    digests = {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in files.items()}
    return {"weights": digests} if digests else {}


def _code(method: Method) -> dict[str, dict[str, str]]:
    # With other code of one's own method, a run does not continue.
    return {"code": code_of(method)} if is_own(method) else {}


def _shortened(n_fallback: Mapping[str, int]) -> dict[str, int]:
    reasons = list(n_fallback.items())
    rest = sum(count for _, count in reasons[MAX_REASONS:])
    return dict(reasons[:MAX_REASONS]) | ({"other reasons": rest} if rest else {})


def _require_no_fallback(outcomes: Iterable[Outcome]) -> None:
    findings = Findings()
    for outcome in outcomes:
        if outcome.problem is not None:
            findings.add(outcome.problem.code, outcome.problem.message, outcome.problem.where)
    findings.raise_if_any()


def _require_estimates(outcomes: Sequence[Outcome]) -> None:
    """Raise `Rejected` where nearly all values are fallbacks: something is wrong with the whole folder."""
    problems = [outcome.problem for outcome in outcomes if outcome.problem is not None]
    if len(problems) < MOST_FALLBACKS * len(outcomes):
        return
    [(reason, count)] = Counter(outcome.reason for outcome in outcomes if outcome.reason).most_common(1)
    first = next(outcome.problem for outcome in outcomes if outcome.problem and outcome.reason == reason)
    message = (
        f"{len(problems):,} of {counted(len(outcomes), 'sequence')} have no estimate, {count:,} of them for "
        f"this reason: {first.message}"
    )
    raise reject(first.code, message, first.where)


def _write_whole(path: Path, data: bytes) -> None:
    new = path.with_name(f"{path.name}.{os.getpid()}.new")
    try:
        new.write_bytes(data)
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)
