"""The site serves the evaluator's wheel: built here, installable without an index, and nothing else in it."""

import hashlib
import os
import subprocess
import sys
import venv
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from sysconfig import get_path
from zipfile import ZipFile

import pytest
from django.http import FileResponse
from django.test import Client, override_settings

from leaderboard.management.commands import build_wheel
from leaderboard.web.docs.wheels import EXAMPLES
from tests import pages
from tests.leaderboard.web.test_every_page import assert_sound

pytestmark = pytest.mark.slow

SITE = "https://board.example.org"
# Code, tables of the paper, weights, what `tsttc new-method` writes, and the mark of typed packages.
SUFFIXES = {"py", "json", "npz", "txt", "typed"}


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A site that has built its wheel; the wheel."""
    folder = tmp_path_factory.mktemp("dist")
    with override_settings(DIST_DIR=folder, SITE_URL=SITE):
        yield build_wheel.build()


def served(client: Client, wheel: Path) -> bytes:
    answer = client.get(f"/dist/{wheel.name}")
    assert isinstance(answer, FileResponse)
    assert answer.status_code == 200
    return answer.getvalue()


def test_the_page_shows_the_line_that_installs_it_its_version_and_its_digest(
    client: Client, benchmark: None, dist: Path
) -> None:
    root = assert_sound(client.get("/dist/"))
    address = f"{SITE}/dist/{dist.name}"
    lines = [pre.text for pre in root.all("pre")]
    assert lines[0] == f"pip install {address}"
    digest = hashlib.sha256(served(client, dist)).hexdigest()
    assert f'pip install "{address}#sha256={digest}"' in lines
    assert digest in root.one("dl").text
    assert f"tsttc {dist.name.split('-')[1]}" in root.one("article").text
    assert lines[0] in [pre.text for pre in pages.get(client, "/docs/").all("pre")]


def test_the_wheel_has_the_evaluator_and_the_baselines_and_nothing_of_the_site(
    client: Client, benchmark: None, dist: Path
) -> None:
    with ZipFile(BytesIO(served(client, dist))) as archive:
        names = archive.namelist()
        assert archive.testzip() is None
    packages = {name.partition("/")[0] for name in names if ".dist-info/" not in name}
    assert packages == set(build_wheel.PACKAGES)
    assert {name.rpartition(".")[2] for name in names if ".dist-info/" not in name} <= SUFFIXES


def test_the_wheel_installs_into_an_empty_environment_and_prints_its_version(
    client: Client, benchmark: None, dist: Path, tmp_path: Path
) -> None:
    """Without an index, so the libraries that it needs are those of this environment."""
    home = tmp_path / "environment"
    venv.create(home, with_pip=False, symlinks=True)
    wheel = tmp_path / dist.name
    wheel.write_bytes(served(client, dist))
    pip = [
        sys.executable,
        "-m",
        "pip",
        "--disable-pip-version-check",
        "--python",
        str(home / "bin" / "python"),
    ]
    subprocess.run([*pip, "install", "--quiet", "--no-deps", "--no-index", str(wheel)], check=True)
    environment = os.environ | {"PYTHONPATH": get_path("purelib")}
    version = subprocess.run(
        [home / "bin" / "tsttc", "--version"],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert version.stdout == f"tsttc {dist.name.split('-')[1]}\n"
    script = "import evaluator; print(evaluator.__file__)"
    location = subprocess.run(
        [home / "bin" / "python", "-c", script],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert Path(location.stdout.strip()).is_relative_to(home)


def test_examples_are_served_beside_the_wheel(client: Client, benchmark: None, dist: Path) -> None:
    pages.get(client, "/dist/").one("a", href=f"/dist/{EXAMPLES}")
    with ZipFile(BytesIO(served(client, dist.with_name(EXAMPLES)))) as archive:
        names = set(archive.namelist())
    assert {"tsttc-examples/truth.csv", "tsttc-examples/baseline/boxes.csv"} <= names
    assert not [name for name in names if "__pycache__" in name]


def test_without_a_wheel_the_page_says_so_in_words(client: Client, benchmark: None, tmp_path: Path) -> None:
    with override_settings(DIST_DIR=tmp_path / "none"):
        answer = client.get("/dist/")
        assert answer.status_code == 404
        assert "no wheel to install at the moment" in assert_sound(answer).one("article").text
        assert client.get("/dist/tsttc-0.1.0-py3-none-any.whl").status_code == 404
        assert "pip install ." in [pre.text for pre in pages.get(client, "/docs/").all("pre")]


def test_nothing_but_wheels_and_examples_is_served(client: Client, benchmark: None, dist: Path) -> None:
    dist.with_name("secret.txt").write_text("secret")
    for name in ("secret.txt", "..%2Fsettings.py", f".{dist.name}", "tsttc-9-py3-none-any.whl"):
        assert client.get(f"/dist/{name}").status_code == 404
