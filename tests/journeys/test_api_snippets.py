"""Every request on the pages of the API runs as it is printed there: the curl line, and the Python."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from django.test import Client
from pytest_django.fixtures import Settings
from pytest_django.live_server_helper import LiveServer

from leaderboard.models import Split, User
from leaderboard.web.docs.api_examples import DRAFT, EXAMPLES, METHOD, MISNAMED, OTHER, SUBMISSION
from tests import builders, pages
from tests.leaderboard.web.docs.test_api_examples import METHODS, open_draft
from tests.services import REQUIRED

pytestmark = pytest.mark.slow


class World:
    """The site of the examples, served over HTTP, with the ids that its rows have there."""

    def __init__(self, *, url: str, folder: Path) -> None:
        self.url, self.folder = url, folder
        self.tokens: dict[str, str] = {}
        self.ids: dict[str, str] = {}

    def snippets(self, operation: str) -> tuple[str, str]:
        """The curl line and the Python of an operation's page, with the ids of this world."""
        blocks = [
            pre.raw_text for pre in pages.get(Client(), f"/docs/api/{operation}/").one("main").all("pre")
        ]
        python = next((block for block in blocks if block.startswith("import ")), "")
        return self._with_ids(blocks[0]), self._with_ids(python)

    def run(self, operation: str) -> None:
        """Run both; whichever fails raises."""
        curl, python = self.snippets(operation)
        environment = os.environ | {"TSTTC_TOKEN": self.tokens[EXAMPLES[operation].by]}
        if python:
            exec(compile(python, f"{operation}.py", "exec"), {})
        builders.score_all()
        line = curl.replace("curl ", "curl --silent --show-error --fail-with-body ", 1)
        done = subprocess.run(
            ["bash", "-c", line],
            capture_output=True,
            text=True,
            env=environment,
            cwd=self.folder,
            check=False,
        )
        assert done.returncode == 0, f"{curl}\n{done.stdout}\n{done.stderr}"

    def _with_ids(self, text: str) -> str:
        for example, real in self.ids.items():
            text = text.replace(example, real)
        return text


@pytest.fixture
def world(
    transactional_db: None,
    live_server: LiveServer,
    benchmark: None,
    tmp_path: Path,
    settings: Settings,
    monkeypatch: pytest.MonkeyPatch,
) -> World:
    """Three methods on `val`, two compared, and a draft edition."""
    settings.SITE_URL = live_server.url
    made = World(url=live_server.url, folder=tmp_path)
    owner = User.objects.create_user("owner@example.org", "correct horse", name="Owls")
    maintainer = User.objects.create_superuser("maintainer@example.org", "correct horse")
    made.tokens = {"owner": builders.token(owner), "maintainer": builders.token(maintainer)}
    edition = builders.import_truth(tmp_path, split="val")
    Split.objects.filter(pk="val").update(quota_limit=50)
    for name, factor, example in METHODS:
        seen_by = "PRIVATE" if example == DRAFT else "PUBLIC"
        data = builders.predictions(edition, factor=factor)
        submission = builders.submit(owner, data, method=name, split="val", visibility=seen_by)
        made.ids[example] = str(submission.method_id)
        if example in {METHOD, DRAFT}:
            made.ids[SUBMISSION if example == METHOD else MISNAMED] = str(submission.pk)
    builders.score_all()
    builders.infer_all()
    Client().get(f"/api/v1/compare?split=val&m={made.ids[METHOD]}&m={made.ids[OTHER]}")
    builders.infer_all()
    open_draft(tmp_path)
    (tmp_path / "predictions.json").write_bytes(builders.predictions(edition, factor=1.02))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TSTTC_TOKEN", made.tokens["owner"])
    return made


def test_curl_and_python_of_every_page_of_the_api_run_as_they_stand(world: World) -> None:
    if shutil.which("curl") is None:
        assert not REQUIRED, "curl is missing"
        pytest.skip("there is no curl")
    for operation in EXAMPLES:
        world.run(operation)
