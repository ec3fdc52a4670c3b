"""A file with keys that a correction removed gets a message with the edition; drafts are never named."""

import json
from pathlib import Path

import pytest

from evaluator.predictions import former
from leaderboard.models import Edition, Split, Status, User
from leaderboard.models.benchmark import Listing
from leaderboard.storage import truth_values
from tests import builders
from tests.editions import corrected, extended, open_edition, publish, roll_back


def problem_of(user: User, predictions: dict[str, float] | bytes) -> str:
    """The first problem of a file that is sent now."""
    data = predictions if isinstance(predictions, bytes) else json.dumps(predictions).encode()
    submission = builders.submit(user, data, method="Old keys")
    builders.score_all()
    row = submission.evaluations.get(edition=submission.split.current_edition)
    assert row.status == Status.REJECTED
    return row.problems[0]["message"]


def by_natural_key(edition: Edition) -> dict[str, float]:
    truth = truth_values.load(edition.ground_truth_id)
    return dict(zip(truth.manifest.natural_keys, truth.ttc_s.tolist(), strict=True))


def csv(predictions: dict[str, float]) -> bytes:
    rows = [[*key.split("/"), repr(value)] for key, value in predictions.items()]
    return "\n".join(
        ",".join(row) for row in [["bag_stamp", "cam_id", "ts", "track_id", "ttc"], *rows]
    ).encode()


@pytest.mark.slow
def test_a_removed_sequence_is_named_as_such_with_the_edition(
    edition: Edition, owner: User, tmp_path: Path
) -> None:
    old = by_natural_key(edition)
    builders.import_truth(tmp_path, split="val", seed=3)
    publish(open_edition(corrected(tmp_path, factor=1.3)))
    publish(open_edition(corrected(tmp_path, drop="0002")), replaces=2)
    sentence = "was in the manifest until edition 2: edition 3 removed it."
    assert sentence in problem_of(owner, old)
    assert sentence in problem_of(owner, csv(old))
    assert "edition" not in problem_of(owner, {"0099/1/5/1": 1.0})


def test_keys_of_an_edition_that_was_rolled_back_are_not_called_removed(
    edition: Edition, owner: User, tmp_path: Path
) -> None:
    publish(open_edition(extended(tmp_path)), leave_out=True)
    roll_back()
    sent = by_natural_key(edition) | {"0001/9/700000000/1": 3.5}
    expected = "is in the manifest of edition 2, which is not the current one."
    assert expected in problem_of(owner, sent)


def test_keys_of_a_draft_are_unknown_and_nothing_more(edition: Edition, owner: User, tmp_path: Path) -> None:
    open_edition(extended(tmp_path))
    sent = by_natural_key(edition) | {"0001/9/700000000/1": 3.5}
    assert "edition" not in problem_of(owner, sent)


def by_anno_id(edition: Edition) -> dict[str, float]:
    truth = truth_values.load(edition.ground_truth_id)
    return dict(zip(truth.manifest.anno_id_keys, truth.ttc_s.tolist(), strict=True))


@pytest.mark.slow
def test_a_file_that_fits_an_earlier_edition_gets_the_command_that_repairs_it(
    edition: Edition, owner: User, tmp_path: Path
) -> None:
    builders.import_truth(tmp_path, split="val", seed=3)
    numbered, natural = by_anno_id(edition), by_natural_key(edition)
    publish(open_edition(corrected(tmp_path, factor=1.3)))
    publish(open_edition(corrected(tmp_path, drop="0002")), replaces=2)
    # Edition 2 has the manifest of edition 1: the later one is named.
    assert former.advice(split="test", edition=2, keys="anno_id") in problem_of(owner, numbered)
    assert former.advice(split="test", edition=2, keys="natural_key") in problem_of(owner, natural)
    assert former.advice(split="test", edition=2, keys="natural_key") in problem_of(owner, csv(natural))
    # What the natural repair of the keys would make of it fits no edition, and neither does a faulty file.
    assert "fits the manifest" not in problem_of(owner, dict(list(numbered.items())[:-1]))
    assert "fits the manifest" not in problem_of(owner, numbered | {"0": 0.0})


def test_a_file_that_lacks_the_sequences_of_a_new_edition_gets_it_too(
    edition: Edition, owner: User, tmp_path: Path
) -> None:
    numbered = by_anno_id(edition)
    publish(open_edition(extended(tmp_path)), leave_out=True)
    assert former.advice(split="test", edition=1, keys="anno_id") in problem_of(owner, numbered)


@pytest.mark.slow
def test_a_file_of_another_split_is_named_as_such(edition: Edition, owner: User, tmp_path: Path) -> None:
    val = builders.import_truth(tmp_path, split="val", seed=3)
    off = builders.import_truth(tmp_path, split="demo", seed=4)
    sentence = 'The file fits the split "val", and was sent to "test".'
    assert sentence in problem_of(owner, builders.predictions(val))
    assert sentence in problem_of(owner, csv(by_natural_key(val)))
    some = dict(list(by_natural_key(val).items())[1:])
    assert "fits" not in problem_of(owner, some)
    Split.objects.filter(pk="demo").update(listing=Listing.OFF)
    assert "fits" not in problem_of(owner, builders.predictions(off))
