"""The action of the recipe for GitHub where a file has a warning: nothing is sent, and the log says why."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.evaluator.cli.console import ID
from tests.evaluator.cli.recorded_site import RecordedSite, Reply
from tests.evaluator.worlds import EXAMPLES, REPOSITORY
from tests.journeys import recipes

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the jobs run on Linux")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("confirmed", "exit_code", "n_sent"), [("", 10, 0), ("false", 10, 0), ("true", 0, 1)]
)
def test_a_file_with_a_warning_is_sent_once_the_job_confirms_it(
    site: RecordedSite, tmp_path: Path, confirmed: str, exit_code: int, n_sent: int
) -> None:
    manifest = (EXAMPLES / "manifest.csv").read_bytes()
    keys = [line.split(",")[0] for line in manifest.decode().splitlines()[1:]]
    (tmp_path / "predictions.json").write_text(json.dumps(dict.fromkeys(keys, 2500.0)))
    site.put("GET /api/v1/splits/val/manifest", Reply(manifest, headers={"Content-Type": "text/csv"}))
    site.put("GET /api/v1/methods", Reply([]))
    scored = {
        "id": ID,
        "state": "SCORED",
        "split": "val",
        "method": "Foo++",
        "scores": {"mid": 13.9, "rte": 9.0},
    }
    site.put("POST /api/v1/submissions", Reply(scored, status=201))
    site.put(f"GET /api/v1/submissions/{ID}", Reply(scored))
    program = tmp_path / "tsttc" / "bin" / "tsttc"
    program.parent.mkdir(parents=True)
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m evaluator "$@"\n')
    program.chmod(0o755)
    recipe = recipes.github()
    surroundings = os.environ | recipe.environment | {"PYTHONPATH": str(REPOSITORY), "FAIL_IF": ""}
    surroundings |= {
        "TSTTC_URL": site.url,
        "TSTTC_TOKEN": "secret-token",
        "CONFIRMED": confirmed,
        "WORSE_THAN": "",
    }
    surroundings |= {
        "RUNNER_TEMP": str(tmp_path),
        "GITHUB_SHA": "c0ffee",
        "GITHUB_STEP_SUMMARY": "summary.md",
    }
    done = subprocess.run(
        ["bash", "-e", "-o", "pipefail", "-c", recipe.steps[-1]],
        cwd=tmp_path,
        env=surroundings,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, len(site.posts)) == (exit_code, n_sent), done.stderr
    assert ("::error::Nothing was sent" in done.stdout) is (exit_code == 10)
    assert "milliseconds" in done.stderr
