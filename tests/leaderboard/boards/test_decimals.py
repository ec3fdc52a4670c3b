"""Published decimals: a policy of the split, frozen in each edition, the same in every form."""

import csv
import io
import json
import re
from pathlib import Path

import pytest
from django.db import IntegrityError, transaction
from django.test import Client
from django.utils import timezone

from leaderboard.editions import corrections, preview
from leaderboard.errors.refusals import Refused
from leaderboard.models import Edition, Split, Submission, User
from tests import builders
from tests.editions import publish


def open_again(*, decimals: int) -> Edition:
    Split.objects.filter(pk="test").update(decimals=decimals)
    return corrections.open_edition(split_name="test", now=timezone.now(), actor=None)


def test_hidden_splits_publish_one_decimal_and_open_ones_two(benchmark: None) -> None:
    assert dict(Split.objects.values_list("name", "decimals")) == {"test": 1, "val": 2, "demo": 2}


def test_an_edition_has_its_decimals_for_ever_and_the_next_one_those_of_the_split(
    entries: list[Submission], edition: Edition
) -> None:
    with pytest.raises(Refused, match=r"number of decimals \(1\), and is the current board already"):
        open_again(decimals=1)
    second = open_again(decimals=2)
    assert (second.number, second.decimals, second.ground_truth_id) == (2, 2, edition.ground_truth_id)
    assert open_again(decimals=2) == second
    edition.refresh_from_db()
    assert edition.decimals == 1
    builders.score_all()
    for change in preview.preview(second).changes:
        for name, value in change.new.items():
            assert value is not None
            assert value == round(value, 2)
            assert abs(value - change.old[name]) < 0.051
    publish(second)
    assert open_again(decimals=1) == edition


def test_other_decimals_than_one_and_two_are_refused_by_the_database(edition: Edition) -> None:
    with pytest.raises(IntegrityError), transaction.atomic():
        Edition.objects.update(decimals=3)
    with pytest.raises(IntegrityError), transaction.atomic():
        Split.objects.update(decimals=0)


@pytest.mark.slow
@pytest.mark.parametrize("decimals", [1, 2])
def test_every_form_has_the_editions_decimals(
    benchmark: None, tmp_path: Path, owner: User, client: Client, decimals: int
) -> None:
    Split.objects.filter(pk="test").update(decimals=decimals)
    edition = builders.import_truth(tmp_path)
    submission = builders.submit(owner, builders.predictions(edition), method="Foo")
    builders.submit(owner, builders.predictions(edition, factor=1.2), method="Bar")
    builders.score_all()
    builders.infer_all()
    client.force_login(owner)

    rows = csv.DictReader(io.StringIO(client.get("/board/test.csv?intervals=1").text))
    row = next(row for row in rows if row["method"] == "Foo")
    texts = {name: row[name] for name in ("mid", "rte_small", "mid_low", "mid_high")}
    for form in ("tex", "md"):
        body = client.get(f"/board/test.{form}?intervals=1").text
        line = next(line for line in body.splitlines() if "Foo" in line)
        assert texts["mid"] in line
        assert texts["mid_high"] in line
    match = re.search(r"MiD ([\d.]+)", client.get("/board/test/feed.atom").text)
    assert match is not None
    texts["feed"] = match[1]
    assert {name: len(text.partition(".")[2]) for name, text in texts.items()} == dict.fromkeys(
        texts, decimals
    )
    board = json.loads(client.get("/api/v1/splits/test/board?intervals=1").content)
    assert board["decimals"] == decimals
    for entry in board["entries"]:
        assert entry["decimals"] == (1 if entry["kind"] == "published" else decimals)
    answers = ("submissions/" + str(submission.pk), "splits/test/editions")
    for answer in answers:
        document = json.loads(client.get(f"/api/v1/{answer}").content)
        assert (document[0] if isinstance(document, list) else document)["decimals"] == decimals
