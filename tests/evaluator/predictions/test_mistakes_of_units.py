"""Mistakes of unit, rate, sign and order are named; files of simulated and real driving have no warning."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evaluator import GroundTruth, Predictions, read_predictions, read_truth, write_predictions
from evaluator.metrics.scale import Floats, scale_ratio_to_ttc, ttc_to_scale_ratio
from evaluator.predictions.plausibility import warnings_of, warnings_with_truth
from leaderboard.demo import runs
from tests.evaluator.worlds import EXAMPLES, GOLDEN, Tsttc, flat, make_truth
from tsttc_baselines import simulation

File = tuple[GroundTruth, Floats]


def codes(file: File) -> list[str]:
    truth, ttc_s = file
    return [one.code for one in warnings_of(Predictions.from_arrays(manifest=truth.manifest, ttc_s=ttc_s))]


def codes_with_truth(file: File) -> list[str]:
    truth, ttc_s = file
    predictions = Predictions.from_arrays(manifest=truth.manifest, ttc_s=ttc_s)
    return [one.code for one in warnings_with_truth(predictions, truth)]


def with_noise(ttc_s: Floats, *, sigma: float) -> Floats:
    return -1 / (-1 / ttc_s + np.random.default_rng(7).normal(0, sigma, len(ttc_s)))


@pytest.fixture(scope="module")
def drive() -> GroundTruth:
    rng = np.random.default_rng(11)
    return simulation.split(rng=rng, n_sequences=2_500, n_recordings=60, shape=simulation.SHAPES["val"]).truth


@pytest.fixture(scope="module")
def good(drive: GroundTruth) -> dict[str, File]:
    """Files without a mistake: the truth, noisy estimates, and estimates that are somewhat too long."""
    return {
        "the truth": (drive, drive.ttc_s),
        "MiD 15": (drive, with_noise(drive.ttc_s, sigma=0.02)),
        "MiD 40": (drive, with_noise(drive.ttc_s, sigma=0.05)),
        "a quarter too long": (drive, 1.25 * drive.ttc_s),
        "a quarter too short": (drive, 0.8 * drive.ttc_s),
        "without an estimate for each tenth": (
            drive,
            np.where(np.arange(drive.n_sequences) % 10 == 0, 1e6, drive.ttc_s),
        ),
    }


def ratios(ttc_s: Floats, fps_hz: float) -> Floats:
    return np.maximum(ttc_to_scale_ratio(ttc_s, fps_hz=fps_hz), 1e-3)


MISTAKES: dict[str, tuple[Callable[[Floats], Floats], str, str]] = {
    "ratios at 10 Hz read at 2 Hz": (lambda ttc_s: 5 * ttc_s, "wrong-rate", "wrong-rate"),
    "ratios at 2 Hz read at 10 Hz": (lambda ttc_s: ttc_s / 5, "wrong-rate", "wrong-rate"),
    "ratios of areas": (lambda ttc_s: ttc_s / 2, "wrong-rate", "wrong-rate"),
    "frames": (lambda ttc_s: 10 * ttc_s, "wrong-rate", "wrong-rate"),
    "milliseconds": (lambda ttc_s: 1000 * ttc_s, "not-seconds", "not-seconds"),
    "signs": (lambda ttc_s: -ttc_s, "flipped-signs", "unlike-truth"),
    "target / reference": (lambda ttc_s: -ttc_s - 0.5, "flipped-signs", "unlike-truth"),
    "1/τ": (lambda ttc_s: 1 / ttc_s, "inverse-times", "unlike-truth"),
    "-1/τ": (lambda ttc_s: -1 / ttc_s, "inverse-times", "unlike-truth"),
    "ln α": (lambda ttc_s: np.log(ratios(ttc_s, 2)), "inverse-times", "unlike-truth"),
    "ln α at 10 Hz": (lambda ttc_s: np.log(ratios(ttc_s, 10)), "inverse-times", "unlike-truth"),
    "α - 1": (lambda ttc_s: ratios(ttc_s, 2) - 1, "inverse-times", "unlike-truth"),
    "α": (lambda ttc_s: ratios(ttc_s, 2), "looks-like-ratios", "looks-like-ratios"),
    "100 α": (lambda ttc_s: 100 * ratios(ttc_s, 2), "not-seconds", "not-seconds"),
    "1 - α": (lambda ttc_s: 1 - ratios(ttc_s, 2), "inverse-times", "unlike-truth"),
    "degrees": (np.degrees, "not-seconds", "not-seconds"),
    "ratios at 20 Hz read at 2 Hz": (lambda ttc_s: 10 * ttc_s, "wrong-rate", "wrong-rate"),
    "ratios at 30 Hz read at 10 Hz": (lambda ttc_s: 3 * ttc_s, "wrong-rate", "wrong-rate"),
    "ratios at 10 Hz read at 30 Hz": (lambda ttc_s: ttc_s / 3, "wrong-rate", "wrong-rate"),
    "ratios at 2 Hz read at 30 Hz": (lambda ttc_s: ttc_s / 15, "wrong-rate", "wrong-rate"),
    "ratios at 10 Hz read at 5 Hz": (lambda ttc_s: 2 * ttc_s, "wrong-rate", "wrong-rate"),
    "α at 10 Hz": (lambda ttc_s: ratios(ttc_s, 10), "looks-like-ratios", "looks-like-ratios"),
    "a constant": (lambda ttc_s: np.full(len(ttc_s), 5.0), "constant-values", "constant-values"),
    "infinities": (
        lambda ttc_s: np.where(np.arange(len(ttc_s)) % 3 == 0, np.inf, ttc_s),
        "infinite-values",
        "infinite-values",
    ),
    "half a second late": (lambda ttc_s: ttc_s + 0.5, "", "shifted-times"),
    "half a second early": (lambda ttc_s: ttc_s - 0.5, "", "shifted-times"),
}


def test_good_files_are_not_warned_of(good: dict[str, File]) -> None:
    assert {name: (codes(file), codes_with_truth(file)) for name, file in good.items()} == {
        name: ([], []) for name in good
    }


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named_with_and_without_the_truth(good: dict[str, File], mistake: str) -> None:
    change, without_truth, with_truth = MISTAKES[mistake]
    for name in ("the truth", "MiD 15"):
        truth, ttc_s = good[name]
        file = truth, change(ttc_s)
        assert codes(file) == [without_truth] * bool(without_truth)
        assert codes_with_truth(file) == [with_truth]


def test_negative_ratios_are_named_as_such(good: dict[str, File]) -> None:
    for name in ("the truth", "MiD 15"):
        truth, ttc_s = good[name]
        predictions = Predictions.from_arrays(manifest=truth.manifest, ttc_s=-ratios(ttc_s, 2))
        [warning] = warnings_of(predictions)
        assert "between -1.5 and -0.5 s" in warning.message
        assert "the negative of scale ratios" in warning.message
        assert "looks-like-ratios" in codes_with_truth((truth, predictions.ttc_s))


@pytest.mark.parametrize("change", [np.abs, lambda ttc_s: -np.abs(ttc_s), lambda ttc_s: ttc_s.clip(0.1, 10)])
def test_a_lost_sign_is_warned_of(good: dict[str, File], change: Callable[[Floats], Floats]) -> None:
    for name in ("the truth", "MiD 15", "MiD 40"):
        truth, ttc_s = good[name]
        file = truth, change(ttc_s)
        assert set(codes(file)) & {"one-sign", "flipped-signs", "wrong-rate"}
        assert codes_with_truth(file)
        few = truth.subset(np.arange(300)), change(ttc_s)[:300]
        assert "one-sign" not in codes(few), "so few objects may all come nearer"


def test_probabilities_are_no_seconds() -> None:
    # Objects that are seen once: no value can be compared with the next one.
    truth = make_truth(np.linspace(0.5, 20, 400))
    shares = np.random.default_rng(3).uniform(0.001, 1, 400)
    assert codes((truth, shares)) == ["within-one-second"]
    assert codes((truth, truth.ttc_s)) == []


def test_the_message_of_a_rate_has_the_slope_and_causes_of_the_unit(drive: GroundTruth) -> None:
    data = write_predictions(manifest=drive.manifest, scale_ratio=ratios(drive.ttc_s, 2), fps_hz=10)
    [warning] = warnings_of(read_predictions(data, manifest=drive.manifest))
    assert warning.message == (
        "From one window of an object to the next, the values fall by 0.20 s per second; expected about 1, "
        "as a time to contact does while time passes. Probably fps is too high or frame_gap too small for "
        "these scale ratios, or the ratios are of areas, not lengths."
    )
    inverted = write_predictions(manifest=drive.manifest, scale_ratio=1 / ratios(drive.ttc_s, 2), frame_gap=5)
    [warning] = warnings_of(read_predictions(inverted, manifest=drive.manifest))
    assert warning.message.endswith("the scale ratios are target / reference instead of reference / target.")


def test_the_truth_names_factor_and_shift(drive: GroundTruth) -> None:
    def message(ttc_s: Floats) -> str:
        predictions = Predictions.from_arrays(manifest=drive.manifest, ttc_s=ttc_s)
        [warning] = warnings_with_truth(predictions, drive)
        return warning.message

    assert message(5 * drive.ttc_s).startswith("The predicted times are 5.00 times the true ones ")
    assert message(drive.ttc_s + 0.5).startswith("The predicted times are 0.50 s too late, near and far ")
    assert "Probably the values are inverse times, 1/τ" in message(1 / drive.ttc_s)
    assert "Probably the values are logarithms of scale ratios" in message(-1 / drive.ttc_s)


def test_recordings_whose_values_belong_to_others_are_named(drive: GroundTruth) -> None:
    for n_recordings in (3, 20):
        recordings = drive.manifest.recordings[-n_recordings:]
        rows = np.flatnonzero(np.isin(drive.manifest.bag_stamp, recordings))
        ttc_s = drive.ttc_s.copy()
        ttc_s[rows] = np.roll(ttc_s[rows], 6)
        assert codes_with_truth((drive, ttc_s)) == ["unlike-recordings"]
        predictions = Predictions.from_arrays(manifest=drive.manifest, ttc_s=ttc_s)
        [warning] = warnings_with_truth(predictions, drive)
        named = {name for name in drive.manifest.recordings if name in warning.message}
        assert named <= set(recordings)
        assert len(named) >= n_recordings / 2


def test_a_file_of_an_earlier_edition_is_warned_of_by_score(
    drive: GroundTruth, tsttc: Tsttc, tmp_path: Path
) -> None:
    # Without the first recording, and numbered again: the natural repair is to delete the last keys.
    rows = np.flatnonzero(np.array(drive.manifest.bag_stamp) != drive.manifest.recordings[0])
    table = drive.subset(rows).to_table()
    table.anno_id = list(range(len(rows)))
    new = GroundTruth.from_table(table)
    old = dict(zip(drive.manifest.anno_id_keys, drive.ttc_s.tolist(), strict=True))
    mine = tmp_path / "mine.json"
    mine.write_text(json.dumps({key: old[key] for key in new.manifest.anno_id_keys}))
    (tmp_path / "new.csv").write_bytes(new.to_csv())
    scored = tsttc("score", mine, "--truth", tmp_path / "new.csv")
    assert "Warning: In " in scored.stderr or "Warning: The predictions hardly match" in scored.stderr
    assert "tsttc convert FILE" in scored.stderr


# --- all good files that are here -----------------------------------------------------------------------


@pytest.mark.slow
def test_the_demo_s_runs_are_not_warned_of_and_the_run_on_areas_is() -> None:
    truth = runs.demo_split().truth
    for run in runs.RUNS:
        file = truth, scale_ratio_to_ttc(run.kept(), fps_hz=2)
        expected = ["wrong-rate"] if run.name == "detection-area" else []
        assert (run.name, codes(file), codes_with_truth(file)) == (run.name, expected, expected)


def test_the_example_files_are_not_warned_of() -> None:
    truth = read_truth(EXAMPLES / "truth.csv")
    for name in ("predictions.json", "predictions.scale_ratio.json"):
        predictions = read_predictions(EXAMPLES / name, manifest=truth.manifest)
        assert (warnings_of(predictions), warnings_with_truth(predictions, truth)) == ([], [])


@pytest.mark.parametrize("name", ["box-area", "box-sqrt-area", "box-height", "pointrcnn-height"])
def test_estimators_of_real_driving_are_warned_of_where_they_are_wrong_alone(kitti: Path, name: str) -> None:
    truth = read_truth(kitti / "truth.csv")
    for kind in ("ttc", "scale_ratio"):
        data = (kitti / "predictions" / f"{name}.{kind}.json").read_bytes()
        ttc_s = read_predictions(data, manifest=truth.manifest).ttc_s
        expected = ["wrong-rate"] if name == "box-area" else []
        assert (codes((truth, ttc_s)), codes_with_truth((truth, ttc_s))) == (expected, expected)
        for factor in (5.0, 0.2, 0.5):
            assert codes((truth, factor * ttc_s)) == ["wrong-rate"]
        assert codes((truth, 1 / ttc_s)) == ["inverse-times"]
        assert codes((truth, -ttc_s)) == ["flipped-signs"]


def test_the_golden_files_are_not_warned_of() -> None:
    golden = json.loads(GOLDEN.read_text())
    truth = make_truth(golden["truth"].values())
    warned_of = {}
    for name, case in golden["cases"].items():
        predictions = read_predictions(flat(case["predictions"]), manifest=truth.manifest)
        warned_of[name] = codes((truth, predictions.ttc_s)), codes_with_truth((truth, predictions.ttc_s))
    assert {name for name, warned in warned_of.items() if warned == ([], [])} >= {
        "noisy",
        "perfect",
        "integers",
    }
    assert warned_of["constant_20"] == (["constant-values"], ["constant-values"])
