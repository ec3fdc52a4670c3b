"""Croissant of a manifest: its own library finds no fault, and loads every sequence of the file."""

import csv
import hashlib
from pathlib import Path

import mlcroissant
import pytest
from django.test import Client

from leaderboard.models import Edition
from tests.editions import corrected, open_edition, publish

# The library's own, of rdflib.
pytestmark = pytest.mark.filterwarnings("ignore:.* deprecated:DeprecationWarning")

ADDRESS = "/api/v1/splits/test/croissant"


@pytest.mark.parametrize("number", [1, 2])
def test_the_library_finds_no_fault_and_loads_what_the_manifest_has(
    edition: Edition, client: Client, tmp_path: Path, number: int
) -> None:
    publish(open_edition(corrected(tmp_path, drop="0003")))
    answer = client.get(ADDRESS, {"edition": number})
    document = answer.json()
    assert answer["Content-Type"] == 'application/ld+json; profile="http://mlcommons.org/croissant/1.1"'
    (described,) = document["distribution"]
    path = tmp_path / "manifest.csv"
    path.write_bytes(client.get(described["contentUrl"]).getvalue())
    assert hashlib.sha256(path.read_bytes()).hexdigest() == described["sha256"]
    dataset = mlcroissant.Dataset(jsonld=document, mapping={"manifest.csv": path})
    assert dataset.metadata.ctx.is_v1_1()
    assert dataset.metadata.issues.report() == ""
    texts = [
        {
            name.removeprefix("sequences/"): value.decode() if isinstance(value, bytes) else str(value)
            for name, value in record.items()
        }
        for record in dataset.records("sequences")
    ]
    rows = list(csv.DictReader(path.read_text().splitlines()))
    for row in rows:
        # The library reads every table with the types that pandas takes it to have.
        row["bag_stamp"] = str(int(row["bag_stamp"]))
    assert texts == rows
    assert len(texts) == (120 if number == 1 else 115)


def test_an_edition_that_was_never_published_has_none(
    edition: Edition, client: Client, tmp_path: Path
) -> None:
    open_edition(corrected(tmp_path, factor=1.5))
    assert client.get(ADDRESS).json()["version"] == "1.0.0"
    codes = [client.get(ADDRESS, {"edition": text}).status_code for text in ("2", "9", "x")]
    assert codes == [404, 404, 400]
    assert client.get("/api/v1/splits/val/croissant").status_code == 404
