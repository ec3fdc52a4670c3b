"""From a file of 28,600 sequences to its report, against a plain Python loop over the same file.

Times are processor time, the best of several runs, with the truth loaded beforehand, as in a worker. What
came out of both is compared as well.
"""

import json
import math
from collections.abc import Callable
from time import process_time

import numpy as np

from benchmarks._site import QUICK
from evaluator import GroundTruth, evaluate, read_predictions, write_predictions
from leaderboard.demo.runs import simulate

N_SEQUENCES = 28_600
SECONDS_PER_FIGURE = 0.2 if QUICK else 2.0


def main() -> None:
    """Print one line per figure, `name = value unit`."""
    rng = np.random.default_rng(20230901)
    truth = simulate(rng=rng, n_sequences=N_SEQUENCES)
    ttc_s = truth.ttc_s * rng.lognormal(0, 0.15, N_SEQUENCES)
    flat = json.dumps(dict(zip(truth.manifest.anno_id_keys, ttc_s.tolist(), strict=True))).encode()
    natural = write_predictions(keys=truth.manifest.natural_keys, ttc_s=ttc_s)
    true_s = true_values(truth)

    def report(data: bytes) -> object:
        return evaluate(read_predictions(data, manifest=truth.manifest), truth)

    for data in (flat, natural):
        scores = evaluate(read_predictions(data, manifest=truth.manifest), truth).scores
        for name, (mid, rte) in plain_loop(flat, true_s).items():
            assert math.isclose(scores[name].mid or 0, mid, rel_tol=1e-9)
            assert math.isclose(scores[name].rte or 0, rte, rel_tol=1e-9)
    loop_s = best_s(lambda: plain_loop(flat, true_s))
    flat_s, natural_s = best_s(lambda: report(flat)), best_s(lambda: report(natural))
    print(f"evaluator.plain_loop = {1e3 * loop_s:.1f} ms")
    print(f"evaluator.file_to_report = {1e3 * flat_s:.1f} ms")
    print(f"evaluator.by_anno_id = {loop_s / flat_s:.1f} x the plain loop")
    print(f"evaluator.by_natural_key = {loop_s / natural_s:.1f} x the plain loop")


def true_values(truth: GroundTruth) -> dict[int, float]:
    """The times to contact by anno_id, as the plain loop takes them."""
    return dict(zip(truth.manifest.anno_id.tolist(), truth.ttc_s.tolist(), strict=True))


def plain_loop(data: bytes, true_s: dict[int, float]) -> dict[str, tuple[float, float]]:
    """Scoring as the dataset's toolkit does it: json, dictionaries, math, a list per TTC range."""
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


def best_s(action: Callable[[], object]) -> float:
    """The shortest processor time of repeated runs, in seconds."""
    action()
    times: list[float] = []
    while sum(times) < SECONDS_PER_FIGURE and len(times) < 50:
        start = process_time()
        action()
        times.append(process_time() - start)
    return min(times)
