"""The benchmark is a file: another file, and the site says nothing of ours."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from django.core.exceptions import ImproperlyConfigured
from django.test import Client
from django.urls import reverse
from pytest_django import Settings

from evaluator.tables.formats import FORMATS
from leaderboard import benchmark
from leaderboard.editions import splits
from leaderboard.models import PublishedResult, Split, Submission
from tests import builders, pages

OTHER = """
name = "EvTTC"
title = "Event camera challenge"
task = "Estimate when two bodies meet."
default_split = "test"
[landing]
heading = "When do they meet?"
text = "Two bodies approach each other."
[dataset]
name = "EvTTC data"
description = "Made-up events."
url = "https://example.org/data"
[paper]
title = "Events"
authors = ["Ada Lovelace", "Charles Babbage"]
year = 2030
url = "https://example.org/paper"
bibtex = "@article{lovelace2030, title = {Events}}"
"""
# Names of variables and of addresses are those of the software.
OURS = re.compile(
    r"TSTTC(?!_)|shi2023|2309\.01539|tusen-ai|Large-Scale Dataset|How long until contact|The paper’s"
)
# Guides are documents of the software, and so are the recorded answers that quote our paper.
DOCUMENTS = re.compile(r"/docs/(?!api/).|/docs/api/(list_published_tables|published_table|croissant)/")
API = ("splits", "splits/test/board", "splits/test/editions", "splits/test/changelog", "published")


def written(folder: Path, text: str = OTHER) -> Path:
    path = folder / "benchmark.toml"
    path.write_text(text, encoding="utf-8")
    return path


def public_addresses(client: Client, entry: Submission) -> list[str]:
    """Every page of the sitemap, the exports, a badge, a feed, and pages for visitors."""
    listed = re.findall(r"<loc>http://[^/]+([^<]+)</loc>", client.get("/sitemap.xml").text)
    exports = [f"/board/test.{each.suffix}" for each in FORMATS]
    embedded = (reverse("badge", args=[entry.method_id]), reverse("feed_of_all"))
    more = ("/accounts/login/", "/compare/", *embedded, "/nowhere/")
    return [*(each for each in listed if not DOCUMENTS.match(each)), *exports, *more]


@pytest.mark.slow
def test_a_site_with_another_file_says_nothing_of_our_benchmark(
    client: Client, entries: list[Submission], settings: Settings, tmp_path: Path
) -> None:
    PublishedResult.objects.all().delete()
    Split.objects.update(description="")
    builders.board_changed("test")
    settings.BENCHMARK = benchmark.read(written(tmp_path))
    addresses = [*public_addresses(client, entries[0]), *(f"/api/v1/{name}" for name in API)]
    assert len(addresses) > 50
    ours = {}
    for address in addresses:
        response = client.get(address, follow=True)
        assert response.status_code < 500, address
        if words := OURS.findall(response.getvalue().decode()):
            ours[address] = words
    assert ours == {}
    assert client.get("/published/").status_code == 404
    landing = pages.get(client, "/")
    assert "When do they meet?" in landing.one("h1").text
    assert "@article{lovelace2030" in landing.one("code", id="citation").text
    bibtex = client.get("/board/test.bib").text
    assert [line for line in bibtex.splitlines() if line.startswith("@")] == [
        "@article{lovelace2030, title = {Events}}",
        "@misc{evttc-leaderboard-test-edition-1,",
    ]


def test_a_benchmark_without_a_paper_cites_the_board_alone(
    client: Client, entries: list[Submission], settings: Settings, tmp_path: Path
) -> None:
    settings.BENCHMARK = benchmark.read(written(tmp_path, OTHER.partition("[paper]")[0]))
    PublishedResult.objects.all().delete()
    builders.board_changed("test")
    assert client.get("/board/test.bib").text.startswith("@misc{evttc-leaderboard-test")
    assert pages.get(client, "/").all("code", id="citation") == []


def test_a_new_installation_begins_with_the_splits_of_the_file(
    db: None, settings: Settings, tmp_path: Path
) -> None:
    PublishedResult.objects.all().delete()
    Split.objects.all().delete()
    first = '\n[[splits]]\nname = "events"\ntitle = "Events"\nis_hidden = true\n'
    text = OTHER.replace('default_split = "test"', 'default_split = "events"')
    settings.BENCHMARK = benchmark.read(written(tmp_path, text + first))
    splits.ensure_splits()
    split = Split.objects.get()
    assert (split.pk, split.is_hidden, split.quota_limit) == ("events", True, 3)
    assert not PublishedResult.objects.exists()


@pytest.mark.parametrize("is_production", [True, False])
def test_a_production_site_begins_without_the_simulated_split(
    db: None, settings: Settings, is_production: bool
) -> None:
    PublishedResult.objects.all().delete()
    Split.objects.all().delete()
    settings.PRODUCTION = is_production
    splits.ensure_splits()
    assert Split.objects.filter(pk="demo").exists() != is_production
    assert Split.objects.filter(pk="test").exists()


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('name = "EvTTC"\n', "", "missing required field `name`"),
        ('name = "EvTTC"\n', 'name = "EvTTC"\ncolour = 1\n', "unknown field `colour`"),
        ("2030", '"soon"', "paper.year is 'soon'; expected `int`, got `str`"),
        ("https://example.org/data", "ftp://x", "dataset.url is 'ftp://x'; expected `str` matching"),
        ("@article{lovelace2030, ", "lovelace, ", "expected an entry such as @misc{key, …}"),
        ("[paper]", "[paper", "benchmark.toml: Expected ']'"),
        (
            "[paper]",
            '[[splits]]\nname = "a"\ntitle = "A"\n[paper]',
            "default_split is 'test'; expected one of a",
        ),
        (
            "[paper]",
            '[[splits]]\nname = "test"\ntitle = "A"\n[paper]\nhas_tables = true',
            "paper.has_tables is True; expected false, or splits for the results of its tables, also val.",
        ),
    ],
)
def test_a_fault_is_named_with_file_key_and_expectation(
    tmp_path: Path, old: str, new: str, problem: str
) -> None:
    with pytest.raises(ImproperlyConfigured) as error:
        benchmark.read(written(tmp_path, OTHER.replace(old, new, 1)))
    assert str(error.value).startswith(str(tmp_path / "benchmark.toml"))
    assert problem in str(error.value)


@pytest.mark.slow
def test_a_process_starts_with_the_file_of_its_variable_or_says_what_is_wrong(tmp_path: Path) -> None:
    def started(**variables: str) -> subprocess.CompletedProcess[str]:
        code = (
            "from django.conf import settings; "
            "print(settings.SPECTACULAR_SETTINGS['TITLE'], settings.ACCOUNT_EMAIL_SUBJECT_PREFIX, sep='|')"
        )
        env = os.environ | {"DJANGO_SETTINGS_MODULE": "leaderboard.settings", "TSTTC_DATA_DIR": str(tmp_path)}
        command = [sys.executable, "-c", code]
        return subprocess.run(command, env=env | variables, capture_output=True, text=True, check=False)

    path = str(written(tmp_path))
    assert started(TSTTC_BENCHMARK=path).stdout == "EvTTC leaderboard API|[EvTTC leaderboard] \n"
    named = started(TSTTC_BENCHMARK=path, TSTTC_SITE_NAME="Course")
    assert named.stdout == "Course API|[Course] \n"
    missing = started(TSTTC_BENCHMARK=str(tmp_path / "nowhere.toml"))
    assert missing.returncode != 0
    assert "nowhere.toml" in missing.stderr
