"""The evaluator's figures: from a file to a report, against a plain Python loop and the bare JSON parse.

`python -m benchmarks.evaluator [N …]` measures for N sequences each, by default 28,600 (the size of the test
set) and 1,000,000. Times are processor time, the best of several runs, with the truth loaded beforehand, as
in a worker; nothing here waits or runs in parallel. Memory is measured in a fresh process: how far the peak
rises above what it was with the file's bytes read.
"""

import gc
import json
import math
import subprocess
import sys
import tempfile
import tracemalloc
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from time import process_time

import msgspec
import numpy as np

from evaluator import GroundTruth, Predictions, evaluate, evaluate_many, read_predictions, write_predictions
from evaluator.truth.csv_tables import Table
from leaderboard.demo.runs import simulate

SIZES = (28_600, 1_000_000)
SEQUENCES_PER_RECORDING = 41
SECONDS_PER_FIGURE = 1.0

_OBJECT = msgspec.json.Decoder(dict[str, float])


def main(sizes: Sequence[int] = SIZES) -> None:
    """Print one line per figure, `name = value unit`."""
    for n in sizes:
        rng = np.random.default_rng(20230901)
        truth = make_truth(n, rng)
        files = make_files(truth, rng)
        measure_speed(truth, files, n)
        measure_memory(truth, files, n)
        if n <= 100_000:
            measure_batch(truth, rng, n)


def make_truth(n: int, rng: np.random.Generator) -> GroundTruth:
    """Simulated sequences with the real test set's shares of the intervals."""
    shares = {(0.3, 3.0): 0.134, (3.0, 6.0): 0.132, (6.0, 20.0): 0.436, (-20.0, -0.5): 0.298}
    ranges = np.array(list(shares))[rng.choice(len(shares), size=n, p=list(shares.values()))]
    ttc_s = rng.uniform(ranges[:, 0], ranges[:, 1])
    return GroundTruth.from_table(
        Table(
            anno_id=list(range(n)),
            bag_stamp=[f"{row // SEQUENCES_PER_RECORDING:06d}" for row in range(n)],
            cam_id=[str((1, 3, 4, 8, 9)[row % 5]) for row in range(n)],
            ts_ns=[1_600_000_000_000_000_000 + 100_000_000 * row for row in range(n)],
            track_id=[str(row % 97) for row in range(n)],
            ttc_s=ttc_s.tolist(),
        )
    )


def make_files(truth: GroundTruth, rng: np.random.Generator) -> dict[str, bytes]:
    """The same predictions in several forms; `flat` is what `json.dump` writes."""
    ttc_s = truth.ttc_s * rng.lognormal(0, 0.15, truth.n_sequences)
    members = dict(zip(truth.manifest.anno_id_keys, ttc_s.tolist(), strict=True))
    order = rng.permutation(truth.n_sequences).tolist()
    keys = truth.manifest.anno_id_keys
    shuffled = {keys[row]: members[keys[row]] for row in order}
    return {
        "flat": json.dumps(members).encode(),
        "compact": write_predictions(manifest=truth.manifest, ttc_s=ttc_s),
        "envelope": write_predictions(manifest=truth.manifest, ttc_s=ttc_s, meta={"model": "benchmark"}),
        "shuffled": json.dumps(shuffled).encode(),
        "natural_keys": write_predictions(keys=truth.manifest.natural_keys, ttc_s=ttc_s),
    }


def plain_loop(data: bytes, true_s: dict[int, float]) -> dict[str, tuple[float, float]]:
    """Scoring as the dataset's toolkit does it: json, dictionaries, math, a list per interval."""
    errors: dict[int, tuple[float, float]] = {}
    predictions = json.loads(data)
    assert {int(key) for key in predictions} == set(true_s)
    for key, value in predictions.items():
        assert value != 0
        clipped = max(min(value, 20), -20)
        true = true_s[int(key)]
        predicted_ratio = 1 / ((1 / (clipped * 10) + 1) + 1e-6)
        true_ratio = 1 / ((1 / (true * 10) + 1) + 1e-6)
        mid = abs(math.log(true_ratio) - math.log(predicted_ratio)) * 10**4
        errors[int(key)] = (mid, abs((clipped - true) / true) * 100)
    means = {}
    for name, low, high in (
        ("overall", -math.inf, math.inf),
        ("crucial", 0, 3),
        ("small", 3, 6),
        ("large", 6, 20),
        ("negative", -20, 0),
    ):
        chosen = [errors[key] for key, true in true_s.items() if low <= true <= high]
        means[name] = (
            sum(mid for mid, _ in chosen) / len(chosen),
            sum(rte for _, rte in chosen) / len(chosen),
        )
    return means


def measure_speed(truth: GroundTruth, files: dict[str, bytes], n: int) -> None:
    true_s = dict(zip(truth.manifest.anno_id.tolist(), truth.ttc_s.tolist(), strict=True))

    def report(data: bytes) -> object:
        return evaluate(read_predictions(data, manifest=truth.manifest), truth)

    scores = evaluate(read_predictions(files["flat"], manifest=truth.manifest), truth).scores
    for name, (mid, rte) in plain_loop(files["flat"], true_s).items():
        assert math.isclose(scores[name].mid or 0, mid, rel_tol=1e-9)
        assert math.isclose(scores[name].rte or 0, rte, rel_tol=1e-9)

    loop = best_s(lambda: plain_loop(files["flat"], true_s))
    stdlib = best_s(lambda: json.loads(files["flat"]))
    fastest = best_s(lambda: _OBJECT.decode(files["flat"]))
    seconds = {form: best_s(partial(report, data)) for form, data in files.items()}
    flat = seconds.pop("flat")
    figure("evaluator", n, "file_size", len(files["flat"]) / 1e6, "MB")
    figure("evaluator", n, "plain_loop", loop * 1e3, "ms")
    figure("evaluator", n, "json_loads", stdlib * 1e3, "ms")
    figure("evaluator", n, "msgspec_dict_str_float", fastest * 1e3, "ms")
    figure("evaluator", n, "file_to_report", flat * 1e3, "ms")
    for form, taken in seconds.items():
        figure("evaluator", n, f"file_to_report_{form}", taken * 1e3, "ms")
    figure("evaluator", n, "speedup_over_plain_loop", loop / flat, "x")
    figure("evaluator", n, "time_per_json_loads", flat / stdlib, "x")
    figure("evaluator", n, "time_per_msgspec_parse", flat / fastest, "x")


def measure_memory(truth: GroundTruth, files: dict[str, bytes], n: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        truth_path, file_path = Path(folder, "truth.npz"), Path(folder, "predictions.json")
        truth.save(truth_path)
        for form in ("flat", "natural_keys"):
            file_path.write_bytes(files[form])
            for way in ("allocated", "resident"):
                command = "from benchmarks import evaluator as e; import sys; e.print_peak(*sys.argv[1:])"
                out = subprocess.run(
                    [sys.executable, "-c", command, way, str(truth_path), str(file_path)],
                    check=True,
                    capture_output=True,
                    cwd=Path(__file__).parents[1],
                )
                figure(
                    "evaluator", n, f"peak_{way}_{form}", int(out.stdout) / len(files[form]), "x file size"
                )


def print_peak(way: str, truth_path: str, file_path: str) -> None:
    """In a process that has read a small file: bytes by which the peak rises while one becomes a report."""
    truth = GroundTruth.load(truth_path)
    data = Path(file_path).read_bytes()
    # What is loaded once, code above all, is no part of what a file costs.
    small = simulate(rng=np.random.default_rng(0), n_sequences=100, n_recordings=10)
    small_file = write_predictions(manifest=small.manifest, ttc_s=small.ttc_s)
    evaluate(read_predictions(small_file, manifest=small.manifest), small)
    gc.collect()
    if way == "allocated":
        tracemalloc.start()
        evaluate(read_predictions(data, manifest=truth.manifest), truth)
        sys.stdout.write(str(tracemalloc.get_traced_memory()[1]))
    else:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
        before = status_bytes("VmHWM")
        evaluate(read_predictions(data, manifest=truth.manifest), truth)
        sys.stdout.write(str(status_bytes("VmHWM") - before))


def status_bytes(name: str) -> int:
    """A figure of /proc/self/status."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(name + ":"))


def measure_batch(truth: GroundTruth, rng: np.random.Generator, n: int) -> None:
    batch = [
        Predictions.from_arrays(
            ttc_s=truth.ttc_s * rng.lognormal(0, 0.15, n), manifest=truth.manifest, digest=f"sha256:{row}"
        )
        for row in range(100)
    ]
    taken = best_s(lambda: evaluate_many(batch, truth))
    figure("evaluator", n, "rescore_per_file", taken * 1e3 / len(batch), "ms")


def best_s(action: Callable[[], object]) -> float:
    """The shortest processor time of repeated runs, in seconds."""
    action()
    times: list[float] = []
    while sum(times) < SECONDS_PER_FIGURE and len(times) < 50:
        start = process_time()
        action()
        times.append(process_time() - start)
    return min(times)


def figure(area: str, n: int, name: str, value: float, unit: str) -> None:
    print(f"{area}.{n}.{name} = {value:.3g} {unit}", flush=True)


if __name__ == "__main__":
    main([int(argument) for argument in sys.argv[1:]] or SIZES)
