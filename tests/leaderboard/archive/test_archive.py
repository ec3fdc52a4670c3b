"""An archive has what everybody sees, is whole by `tsttc verify`, and says nothing of what is not public."""

import json
import re
from datetime import timedelta
from pathlib import Path

import pytest
from django.core.management import CommandError, call_command
from django.test import Client
from django.utils import timezone

from evaluator import archives
from leaderboard.models import Edition, Method, Split, Submission, User
from leaderboard.models.benchmark import Listing
from leaderboard.submissions import intake
from tests import builders, pages
from tests.editions import corrected, open_edition, publish

# PostgreSQL reads an archive as of one moment, for which a transaction must begin with it.
pytestmark = pytest.mark.django_db(transaction=True)

SECRETS = (b"Secretissimo", b"Maskenball", b"Owls of the night", b"example.org/own", b"owner@example.org")


@pytest.fixture
def methods(edition: Edition, owner: User) -> dict[str, Submission]:
    """A public, an anonymous, a private and a withdrawn method, all scored."""
    names = {"PUBLIC": "Offenbach", "ANONYMOUS": "Maskenball", "PRIVATE": "Secretissimo"}
    made = {
        visibility: builders.submit(
            owner,
            builders.predictions(edition, factor=1.1 + 0.1 * number),
            method=name,
            visibility=visibility,
            paper_url="" if visibility == "PUBLIC" else "https://example.org/own",
        )
        for number, (visibility, name) in enumerate(names.items())
    }
    gone = builders.submit(owner, builders.predictions(edition, factor=1.5), method="Gone")
    builders.score_all()
    builders.infer_all()
    intake.withdraw(submission=gone, actor=owner, now=timezone.now() + timedelta(seconds=1))
    return made | {"WITHDRAWN": gone}


def archived(tmp_path: Path) -> dict[str, bytes]:
    folder = tmp_path / "archive"
    call_command("archive", str(folder))
    assert archives.check(folder).problems == ()
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.slow
def test_every_edition_is_there_as_the_site_exports_it(
    methods: dict[str, Submission], client: Client, tmp_path: Path
) -> None:
    publish(open_edition(corrected(tmp_path, factor=1.3)), leave_out=True)
    builders.score_all()
    builders.infer_all()
    files = archived(tmp_path)
    for number in (1, 2):
        address = f"/board/test/editions/{number}"
        for suffix, query in (("csv", "?intervals=1"), ("tex", "?intervals=1"), ("bib", "")):
            exported = client.get(f"{address}.{suffix}{query}").content
            # Nobody visits an address when an archive is made.
            expected = re.sub(rb"  urldate = .*\n", b"", exported)
            assert files[f"boards/test/edition-{number}.{suffix}"] == expected
        answer = client.get(f"/api/v1/splits/test/editions/{number}/board?intervals=1")
        assert json.loads(files[f"boards/test/edition-{number}.json"]) == answer.json()
        manifest = client.get(f"/api/v1/splits/test/manifest?edition={number}").getvalue()
        assert manifest in [data for name, data in files.items() if name.startswith("manifests/")]
    assert {"boards/val/quoted.csv", "paper/main-results.tex", "docs/scoring.md", "pages/licence.md"} <= {
        *files
    }
    index = files["index.html"].decode()
    assert "Edition 1 of Test, not the current one" in index
    assert b"Deep Scale" in files["boards/val/quoted.csv"]
    zenodo = json.loads(files[".zenodo.json"])
    assert {"title", "description", "creators", "upload_type", "license"} <= zenodo.keys()


def test_nothing_is_there_that_only_one_team_may_see(
    methods: dict[str, Submission], owner: User, tmp_path: Path
) -> None:
    pseudonym = Method.objects.get(visibility="ANONYMOUS").pseudonym
    files = archived(tmp_path)
    receipts = [name for name in files if name.startswith(archives.RECEIPTS)]
    assert receipts == [f"receipts/{methods['PUBLIC'].pk}-edition-1.jwt"]
    whole = b"\n".join(files.values())
    for secret in SECRETS:
        assert secret not in whole
    for hidden in ("ANONYMOUS", "PRIVATE", "WITHDRAWN"):
        assert str(methods[hidden].pk).encode() not in whole
    assert pseudonym.encode() in files["index.html"]
    assert b"Offenbach" in files["index.html"]
    assert b"Gone" not in files["index.html"]


def test_the_index_loads_nothing_from_other_hosts(methods: dict[str, Submission], tmp_path: Path) -> None:
    files = archived(tmp_path)
    index = files["index.html"].decode()
    links = re.findall(r'(?:href|src)="([^"#]+)"', index)
    own = [link for link in links if "://" not in link]
    assert {link for link in own if link not in files} == set()
    assert not re.search(r"<script|<img|style=|@import|<iframe", index)
    assert re.findall(r'rel="stylesheet" href="([^"]+)"', index) == ["site.css", "index.css"]
    assert b"url(" not in files["site.css"] + files["index.css"]


@pytest.mark.slow
def test_a_row_of_the_index_says_its_team_and_date_and_links_its_sources(
    benchmark: None, methods: dict[str, Submission], tmp_path: Path
) -> None:
    index = pages.read(archived(tmp_path)["index.html"].decode())
    boards = {each.attributes["aria-label"]: each for each in index.all("div", role="region")}
    own, quoted = (
        {name.text for name in boards[title].all("th", scope="row")}
        for title in ("Board of Test, edition 1", "Board of Validation")
    )
    assert f"Offenbach Owls, {timezone.now():%Y-%m-%d} receipt" in own
    assert "Deep Scale Shi et al., 2023, quoted paper code" in quoted


@pytest.mark.parametrize("name", [".hidden", "thesis.tex"])
def test_a_folder_that_is_not_empty_is_refused(benchmark: None, tmp_path: Path, name: str) -> None:
    folder = tmp_path / "archive"
    folder.mkdir()
    (folder / name).write_text("x")
    with pytest.raises(CommandError, match=f"There is .*/{name}; expected an empty or a new folder"):
        call_command("archive", str(folder))
    assert [path.name for path in folder.iterdir()] == [name]
    with pytest.raises(CommandError, match=r"There is .*; expected an empty or a new folder"):
        call_command("archive", str(folder / name))


def test_a_split_that_is_on_no_page_is_not_in_an_archive(edition: Edition, tmp_path: Path) -> None:
    Split.objects.filter(pk="val").update(listing=Listing.OFF)
    assert not [name for name in archived(tmp_path) if "/val/" in name]
