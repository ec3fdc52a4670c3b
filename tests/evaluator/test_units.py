"""The unit of inference: which it is, where the ground truth names it, and what offline answers say of it."""

import io
import json
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest

from evaluator import (
    GroundTruth,
    Manifest,
    Rejected,
    compare_predictions,
    confidence_intervals,
    read_manifest,
    read_truth,
)
from evaluator.scoring.intervals import recording_sums
from evaluator.scoring.uncertainty import bootstrap_of, by_units
from evaluator.truth.csv_tables import Table
from evaluator.units import DAY, GIVEN, RECORDING, noun_of, units_of
from tests.evaluator.recordings import predictions
from tests.evaluator.worlds import Tsttc

FORMS = {
    "dataset": "{:%Y-%m-%d}-13-00-{:02d}-797143",
    "compact": "{:%Y%m%d}-0815{:02d}",
    "underscores": "{:%Y_%m_%d}_b{:02d}",
}


def names(n_days: int, *, per_day: int = 3, form: str = "dataset") -> list[str]:
    days = [date(2023, 3, 14) + timedelta(days=i) for i in range(n_days)]
    return [FORMS[form].format(day, i) for day in days for i in range(per_day)]


def table(recordings: list[str], *, per_recording: int = 4, unit: list[str] | None = None) -> Table:
    rng = np.random.default_rng(len(recordings))
    n = len(recordings) * per_recording
    return Table(
        anno_id=list(range(n)),
        bag_stamp=[recordings[row % len(recordings)] for row in range(n)],
        cam_id=["1"] * n,
        ts_ns=[1_000 * row for row in range(n)],
        track_id=["1"] * n,
        ttc_s=(rng.uniform(0.5, 25, n) * rng.choice([1, 1, -1], n)).tolist(),
        unit=[unit[row % len(recordings)] for row in range(n)] if unit else [],
    )


def truth_of(n_days: int, *, per_day: int = 3) -> GroundTruth:
    return GroundTruth.from_table(table(names(n_days, per_day=per_day)))


# --- the rule -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", FORMS)
def test_from_30_days_on_the_day_is_the_unit_and_with_29_the_recording(form: str) -> None:
    assert str(units_of(names(29, form=form), given={})) == "87 recordings"
    units = units_of(names(30, form=form), given={})
    assert str(units) == "30 days"
    assert units.index == tuple(i // 3 for i in range(90))
    assert units.names[0] == "2023-03-14"


@pytest.mark.parametrize(
    "name",
    ["sim-20230406-130046", "drive7", "2023-02-30-08-00", "2023-13-01", "1680757246797143", "2023-04_06", ""],
)
def test_one_recording_without_a_date_makes_the_recording_the_unit(name: str) -> None:
    assert units_of([*names(40), name], given={}).kind == RECORDING


def test_the_ground_truths_own_units_replace_the_rule() -> None:
    recordings = names(40)
    given = {name: f"trip{i % 12}" for i, name in enumerate(recordings)}
    assert str(units_of(recordings, given=given)) == "12 units"
    assert units_of(recordings, given=given, kind=DAY).kind == DAY


def test_a_kind_that_the_recordings_do_not_have_is_refused_in_words() -> None:
    with pytest.raises(ValueError, match="begins with a date; expected names as 2023-04-06"):
        units_of(["a", "b"], given={}, kind=DAY)
    with pytest.raises(ValueError, match="no column unit"):
        units_of(names(40), given={}, kind=GIVEN)
    with pytest.raises(ValueError, match="Unknown unit 'week'"):
        units_of(names(40), given={}, kind="week")


# --- the column ---------------------------------------------------------------------------------------------


def test_units_are_a_part_of_both_digests_and_survive_every_form(tmp_path: Path) -> None:
    recordings = names(2)
    truth = GroundTruth.from_table(table(recordings, unit=["a", "b", "b", "c", "c", "c"]))
    without = GroundTruth.from_table(table(recordings))
    assert truth.digest != without.digest
    assert truth.manifest.digest != without.manifest.digest
    assert str(truth.manifest.units) == "3 units"
    truth.save(tmp_path / "truth.npz")
    truth.manifest.save(tmp_path / "manifest.npz")
    again = [
        GroundTruth.load(tmp_path / "truth.npz").manifest,
        Manifest.load(tmp_path / "manifest.npz"),
        read_truth(io.BytesIO(truth.to_csv())).manifest,
        read_manifest(io.BytesIO(truth.manifest.to_csv())),
        read_manifest(io.BytesIO(truth.to_csv())),
    ]
    for manifest in again:
        assert (manifest.digest, manifest.units) == (truth.manifest.digest, truth.manifest.units)


def test_a_recording_in_two_units_is_refused_with_the_row() -> None:
    text = "anno_id,bag_stamp,cam_id,ts,track_id,ttc,unit\n0,r,1,1,1,5.0,a\n1,r,1,2,1,5.0,b\n"
    with pytest.raises(Rejected) as refused:
        read_truth(io.BytesIO(text.encode()))
    (problem,) = refused.value.problems
    assert (problem.code, problem.where) == ("two-units", "line 3")
    assert problem.message == (
        'The recording "r" has the unit "b" here and "a" at line 2; expected one unit for a recording.'
    )


# --- what is computed ---------------------------------------------------------------------------------------


def test_sums_of_a_day_are_those_of_its_recordings() -> None:
    rng = np.random.default_rng(5)
    units = units_of(names(30, per_day=4), given={})
    order = rng.permutation(120)
    shuffled = units_of([names(30, per_day=4)[i] for i in order], given={})
    rows = rng.uniform(size=(2, 120, 3))
    plain = rows.reshape(2, 30, 4, 3).sum(axis=2)
    assert by_units(rows, units) == pytest.approx(plain)
    assert by_units(rows[:, order], shuffled) == pytest.approx(plain)
    assert by_units(rows, units_of(["r"] * 0, given={})) is rows, "recordings are what they were"


def test_intervals_and_comparisons_follow_the_rule_and_another_unit_can_be_asked_for() -> None:
    truth = truth_of(32)
    mine, theirs = predictions(truth, 1), predictions(truth, 2, noise=0.3)
    bags = recording_sums(mine, truth)
    days = truth.manifest.units
    expected = bootstrap_of(truth.digest, by_units(bags.counts, days)).intervals(
        by_units(bags.sums, days)[None]
    )
    by_day = confidence_intervals(mine, truth)
    assert by_day["mid"] == (expected[0][0, 0], expected[1][0, 0])
    assert by_day == confidence_intervals(mine, truth, unit=DAY)
    low, high = bootstrap_of(truth.digest, bags.counts).intervals(bags.sums[None])
    by_recording = confidence_intervals(mine, truth, unit=RECORDING)
    assert by_recording["mid"] == (low[0, 0], high[0, 0]) != by_day["mid"]
    difference = compare_predictions(mine, theirs, truth)["mid"]
    assert (difference.unit, difference.n_effective) == (DAY, 32.0)
    assert compare_predictions(mine, theirs, truth, unit=RECORDING)["mid"].n_effective == 96.0


def test_with_seven_units_there_is_no_interval_however_many_recordings_there_are() -> None:
    recordings = names(40)
    unit = [f"trip{i % 7}" for i in range(len(recordings))]
    truth = GroundTruth.from_table(table(recordings, unit=unit))
    mine, theirs = predictions(truth, 1), predictions(truth, 2)
    assert set(confidence_intervals(mine, truth).values()) == {None}
    difference = compare_predictions(mine, theirs, truth)["mid"]
    assert (difference.low, difference.p, difference.unit) == (None, None, GIVEN)
    assert confidence_intervals(mine, truth, unit=DAY)["mid"] is not None


# --- what the command says ----------------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    truth = truth_of(32)
    (tmp_path / "truth.csv").write_bytes(truth.to_csv())
    for name, noise in (("mine", 0.2), ("theirs", 0.3)):
        values = predictions(truth, len(name), noise=noise).ttc_s.tolist()
        document = dict(zip(truth.manifest.anno_id_keys, values, strict=True))
        (tmp_path / f"{name}.json").write_text(json.dumps(document))
    return tmp_path


def test_score_says_over_which_units_its_intervals_are(tsttc: Tsttc, folder: Path) -> None:
    score = ["score", folder / "mine.json", "--truth", folder / "truth.csv"]
    assert "intervals    95%, bootstrap over 32 days\n" in tsttc(*score, "--intervals").stdout
    document = json.loads(tsttc(*score, "--intervals", "--json").stdout)
    assert (document["unit"], document["n_units"]) == ("day", 32)
    own = json.loads(tsttc(*score, "--intervals", "--unit", "recording", "--json").stdout)
    assert (own["unit"], own["n_units"]) == ("recording", 96)
    assert own["intervals"]["mid"] != document["intervals"]["mid"]
    alone = tsttc(*score, "--unit", "day")
    assert (alone.exit_code, "add --intervals" in alone.stderr) == (2, True)
    given = tsttc(*score, "--intervals", "--unit", "given")
    assert (given.exit_code, "The ground truth has no column unit" in given.stderr) == (2, True)


def test_compare_says_over_which_units_it_tests(tsttc: Tsttc, folder: Path) -> None:
    files = folder / "mine.json", folder / "theirs.json"
    compare = ["compare", *files, "--truth", folder / "truth.csv"]
    assert "95% confidence intervals and p-values over 32 days\n" in tsttc(*compare).stdout
    document = json.loads(tsttc(*compare, "--json").stdout)
    assert (document["unit"], document["n_units"]) == ("day", 32)
    assert document["differences"]["mid"]["n_effective"] == 32
    text = tsttc(*compare, "--unit", "recording").stdout
    assert "95% confidence intervals and p-values over 96 recordings\n" in text
    board = tsttc("compare", "A", "B", "--unit", "day")
    assert (board.exit_code, "--unit needs --truth" in board.stderr) == (2, True)


def test_a_unit_has_a_noun() -> None:
    assert [noun_of(kind) for kind in (RECORDING, DAY, GIVEN)] == ["recording", "day", "unit"]
