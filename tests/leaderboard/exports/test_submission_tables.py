"""All submissions and their numbers as a table, for maintainers."""

import csv
from io import StringIO
from pathlib import Path

import pytest
from django.core.management import CommandError, call_command

from leaderboard.boards.rows import flat_scores
from leaderboard.models import Edition, Evaluation, Submission, User

pytestmark = pytest.mark.django_db


def read(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_every_evaluation_has_a_row_with_the_numbers_that_are_published(
    second: Edition, entries: list[Submission], owner: User, tmp_path: Path
) -> None:
    path, out = tmp_path / "all.csv", StringIO()
    call_command("export_submissions", str(path), stdout=out)
    rows = read(path)
    assert out.getvalue() == f"{path}: {2 * len(entries)} evaluations.\n"
    assert [row["status"] for row in rows].count("QUEUED") == len(entries)
    scored = next(row for row in rows if row["status"] == "SCORED")
    evaluation = Evaluation.objects.get(
        submission__pk=scored["submission"], edition__number=scored["edition"]
    )
    mid = flat_scores(evaluation)["mid"]
    assert mid is not None
    assert float(scored["mid"]) == round(mid, evaluation.edition.decimals)
    assert (scored["is_board"], scored["submitted_by"]) == ("True", str(owner.pk))
    assert "@" not in path.read_text()
    assert path.stat().st_mode & 0o077 == 0


def test_addresses_and_other_splits_are_there_only_if_asked_for(
    entries: list[Submission], owner: User, tmp_path: Path
) -> None:
    path = tmp_path / "all.csv"
    call_command("export_submissions", str(path), split="test", addresses=True, stdout=StringIO())
    assert {row["submitted_by"] for row in read(path)} == {owner.email}
    call_command("export_submissions", str(path), split="val", stdout=StringIO())
    assert read(path) == []


def test_parquet_has_the_rows_of_csv(entries: list[Submission], tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    for name in ("all.csv", "all.parquet"):
        call_command("export_submissions", str(tmp_path / name), stdout=StringIO())
    rows = parquet.read_table(tmp_path / "all.parquet").to_pylist()
    assert [row["submission"] for row in rows] == [row["submission"] for row in read(tmp_path / "all.csv")]
    assert [row["mid"] for row in rows] == [float(row["mid"]) for row in read(tmp_path / "all.csv")]


@pytest.mark.parametrize(
    ("name", "split", "message"),
    [
        ("all.xls", "", r"all.xls ends in '.xls'; expected .csv or .parquet"),
        ("all.csv", "nowhere", "There is no split 'nowhere'"),
        ("no/such/all.csv", "", ""),
    ],
)
def test_what_cannot_be_written_says_so(tmp_path: Path, name: str, split: str, message: str) -> None:
    if not message:
        (tmp_path / "no").write_text("a file, not a folder")
        message = "cannot be written"
    with pytest.raises(CommandError, match=message):
        call_command("export_submissions", str(tmp_path / name), split=split)
