"""Warnings: of files whose values belong to other sequences, and of no others."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evaluator import GroundTruth, Predictions, read_manifest, read_predictions, read_truth, write_predictions
from evaluator.metrics.scale import Floats
from evaluator.predictions.plausibility import MAX_ROUGHNESS, roughness, warnings_of, warnings_with_truth
from evaluator.problems import WARNING_CODES
from evaluator.truth.csv_tables import Table
from tests.evaluator.cli.recorded_site import RecordedSite, Reply
from tests.evaluator.toolkit_folders import driving_folder
from tests.evaluator.worlds import EXAMPLES, Tsttc, flat, make_truth

RNG = np.random.default_rng(7)


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> GroundTruth:
    """Recordings of several objects whose time to contact changes slowly."""
    return read_truth(driving_folder(tmp_path_factory.mktemp("driven") / "annotations"))


def predicted(truth: GroundTruth, ttc_s: Floats) -> Predictions:
    data = flat(dict(zip(truth.manifest.anno_id_keys, ttc_s.tolist(), strict=True)))
    return read_predictions(data, manifest=truth.manifest)


def codes(truth: GroundTruth, ttc_s: Floats) -> tuple[list[str], list[str]]:
    """Codes of the warnings without the truth, and with it."""
    predictions = predicted(truth, ttc_s)
    without_truth = [warning.code for warning in warnings_of(predictions)]
    return without_truth, [warning.code for warning in warnings_with_truth(predictions, truth)]


def with_noise(ttc_s: Floats, sigma: float) -> Floats:
    return -1 / (-1 / ttc_s + RNG.normal(0, sigma, len(ttc_s)))


def test_good_and_mediocre_files_are_not_warned_of(driven: GroundTruth) -> None:
    for ttc_s in (driven.ttc_s, 1.3 * driven.ttc_s, with_noise(driven.ttc_s, 0.05)):
        assert codes(driven, ttc_s) == ([], [])


def test_shuffled_values_are_warned_of(driven: GroundTruth) -> None:
    assert codes(driven, RNG.permutation(driven.ttc_s)) == (["shuffled-values"], ["unlike-truth"])


def test_signs_of_the_other_convention_are_reported_as_that(driven: GroundTruth) -> None:
    assert codes(driven, -driven.ttc_s) == ([], ["unlike-truth"])
    [warning] = warnings_with_truth(predicted(driven, -driven.ttc_s), driven)
    assert "rank correlation is -1.00, and 100% have the opposite sign" in warning.message
    assert warning.message.endswith("Probably every sign is wrong: τ is negative when the object moves away.")


def test_milliseconds_are_distinguished_from_seconds_by_every_command(driven: GroundTruth) -> None:
    assert codes(driven, 1000 * driven.ttc_s) == (["not-seconds"], ["not-seconds"])
    [warning] = warnings_of(predicted(driven, 1000 * driven.ttc_s))
    n = f"{driven.n_sequences:,}"
    assert warning.message.startswith(
        f"{n} of {n} values lie beyond ±20 s; expected most of them within ±20 s. They"
    )


def test_scale_ratios_without_their_unit_are_distinguished_from_seconds(driven: GroundTruth) -> None:
    # Without the two values in a hundred that leave the range.
    ratios = np.clip(1 / (1 + 1 / (2 * driven.ttc_s)), 0.55, 1.45)
    assert {"looks-like-ratios"} <= set(codes(driven, ratios)[0])
    few = make_truth([1.0 + n / 200 for n in range(19)])
    assert codes(few, few.ttc_s) == ([], [])


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (lambda ttc_s: -ttc_s, "Probably every sign is wrong"),
        (lambda ttc_s: 1 / ttc_s, "Probably the values are inverse times, 1/τ; expected seconds."),
        (RNG.permutation, "Probably the anno_ids are those of the dataset's toolkit"),
    ],
)
def test_sixty_sequences_are_enough_to_name_the_cause(change: Callable[[Floats], Floats], cause: str) -> None:
    truth = read_truth(EXAMPLES / "truth.csv")
    [warning] = warnings_with_truth(predicted(truth, change(truth.ttc_s)), truth)
    assert cause in warning.message


def test_scale_ratios_of_their_own_unit_are_not_warned_of(driven: GroundTruth) -> None:
    data = write_predictions(
        manifest=driven.manifest, scale_ratio=1 / (1 + 1 / (2 * driven.ttc_s)), frame_gap=5
    )
    assert warnings_of(read_predictions(data, manifest=driven.manifest)) == []


def approaching(*, n_objects: int = 20, n_windows: int = 8) -> GroundTruth:
    """Objects at constant speed, half of them moving away: all times fall by a second per second."""
    rows = [(one, window) for one in range(n_objects) for window in range(n_windows)]
    return GroundTruth.from_table(
        Table(
            anno_id=list(range(len(rows))),
            bag_stamp=[str(one // 4) for one, _ in rows],
            cam_id=["1"] * len(rows),
            ts_ns=[600_000_000 * window for _, window in rows],
            track_id=[str(one) for one, _ in rows],
            ttc_s=[(8.5 if one % 2 else -3.0) - 0.6 * window for one, window in rows],
        )
    )


def test_flipped_signs_are_seen_without_the_truth() -> None:
    truth = approaching()
    assert codes(truth, truth.ttc_s) == ([], [])
    [warning] = warnings_of(predicted(truth, -truth.ttc_s))
    assert warning.code == "flipped-signs"
    assert "140 of 140 values rise; expected most of them to fall" in warning.message


@pytest.mark.slow
def test_submit_warns_before_it_sends_and_sends_what_is_confirmed(
    tsttc: Tsttc, site: RecordedSite, at_site: None, driven: GroundTruth, tmp_path: Path
) -> None:
    site.put(
        "GET /api/v1/splits/val/manifest",
        Reply(driven.manifest.to_csv(), headers={"Content-Type": "text/csv"}),
    )
    path = tmp_path / "mine.json"
    path.write_bytes(flat(RNG.permutation(driven.ttc_s).tolist()))
    for confirmed, n_posts in (((), 0), (("--yes",), 1)):
        result = tsttc("submit", path, "--split", "val", "--method", "Foo++", *confirmed)
        assert result.stderr.startswith(
            "Warning: The predictions seem to be in another order than the sequences. "
        )
        assert len(site.posts) == n_posts


def test_every_code_is_described_in_the_docs() -> None:
    page = (Path(__file__).resolve().parents[3] / "docs/file-format.md").read_text()
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    for code, meaning in WARNING_CODES.items():
        assert any(line.startswith(f"| `{code}`") and meaning in line for line in rows)


# --- real driving ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def windows(kitti: Path) -> tuple[GroundTruth, np.ndarray]:
    """KITTI's windows as the dataset cuts them, by time; and their rows in the whole table."""
    table = read_truth(kitti / "truth.csv").to_table()
    ends: dict[tuple[str, str, str], int] = {}
    rows = []
    for row in sorted(range(len(table.ts_ns)), key=lambda row: (table.bag_stamp[row], table.ts_ns[row])):
        track = (table.bag_stamp[row], table.cam_id[row], table.track_id[row])
        if table.ts_ns[row] - ends.get(track, -(10**18)) >= 600_000_000:
            rows.append(row)
            ends[track] = table.ts_ns[row]
    columns = {
        name: [getattr(table, name)[row] for row in rows]
        for name in ("bag_stamp", "cam_id", "ts_ns", "track_id", "ttc_s")
    }
    return GroundTruth.from_table(Table(anno_id=list(range(len(rows))), **columns)), np.array(rows)


@pytest.mark.parametrize("name", ["box-area", "box-sqrt-area", "box-height", "pointrcnn-height"])
def test_estimators_of_real_driving_are_not_warned_of_and_their_shuffled_values_are(
    kitti: Path, windows: tuple[GroundTruth, np.ndarray], name: str
) -> None:
    truth, rows = windows
    data = (kitti / "predictions" / f"{name}.ttc.json").read_bytes()
    ttc_s = read_predictions(data, manifest=read_manifest(kitti / "truth.csv")).ttc_s[rows]
    expected = ["wrong-rate"] if name == "box-area" else []
    assert codes(truth, ttc_s) == (expected, expected)
    assert [warning.code for warning in warnings_of(predicted(truth, -ttc_s))] == ["flipped-signs"]
    in_order = roughness(truth.manifest, ttc_s)
    assert in_order is not None
    assert in_order < 0.6 < MAX_ROUGHNESS
    recording = truth.manifest.recording_index
    backwards = np.concatenate([np.flatnonzero(recording == index) for index in reversed(range(11))])
    for order in (RNG.permutation(len(rows)), backwards):
        assert codes(truth, ttc_s[order]) == (["shuffled-values"], ["unlike-truth"])
