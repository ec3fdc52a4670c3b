"""`evaluator.frames`: pandas frames in and out."""

import pytest

from evaluator import GroundTruth, Rejected, evaluate, read_truth
from evaluator.frames import manifest_frame, predictions_from_frame
from tests.evaluator.worlds import EXAMPLES


@pytest.fixture(scope="module")
def truth() -> GroundTruth:
    return read_truth(EXAMPLES / "truth.csv")


def test_frame_of_the_truth_itself_scores_zero_in_any_order(truth: GroundTruth) -> None:
    frame = manifest_frame(truth.manifest)
    frame["ttc_s"] = truth.ttc_s
    report = evaluate(
        predictions_from_frame(frame.sample(frac=1, random_state=0), manifest=truth.manifest), truth
    )
    assert report.scores["crucial"].mid == 0.0
    assert report.n_sequences == len(frame)


def test_sequences_may_be_named_in_a_column(truth: GroundTruth) -> None:
    frame = manifest_frame(truth.manifest).reset_index().assign(mine=5.0)
    by_column = predictions_from_frame(frame, manifest=truth.manifest, column="mine")
    assert set(by_column.ttc_s.tolist()) == {5.0}


@pytest.mark.parametrize("code", ["missing-keys", "duplicate-keys", "nan"])
def test_fault_of_a_frame_has_the_words_of_a_file(truth: GroundTruth, code: str) -> None:
    frame = manifest_frame(truth.manifest).assign(ttc_s=5.0)
    if code == "nan":
        frame.loc[frame.index[3], "ttc_s"] = float("nan")
    frame = frame.iloc[1:] if code == "missing-keys" else frame
    rows = [*range(len(frame)), 0] if code == "duplicate-keys" else [*range(len(frame))]
    with pytest.raises(Rejected) as caught:
        predictions_from_frame(frame.iloc[rows], manifest=truth.manifest)
    assert code in {problem.code for problem in caught.value.problems}


def test_row_numbers_are_not_taken_for_anno_ids(truth: GroundTruth) -> None:
    frame = manifest_frame(truth.manifest).assign(ttc_s=truth.ttc_s)[["ttc_s"]].reset_index(drop=True)
    with pytest.raises(ValueError, match="does not name the sequences; expected the columns bag_stamp"):
        predictions_from_frame(frame, manifest=truth.manifest)
    with pytest.raises(KeyError, match="no column 'mine'; found ttc_s"):
        predictions_from_frame(frame, manifest=truth.manifest, column="mine")
