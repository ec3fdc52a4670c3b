"""The recipes for CI as a runner reads them: their jobs' shell steps, in order."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from tests.journeys.production import REPOSITORY

FOLDER = REPOSITORY / "examples" / "ci"
INSTALL = 'python -m pip install "tsttc @ $TSTTC_SOURCE"'


@dataclass(frozen=True)
class Recipe:
    """The variables and the shell steps of a job, without what installs the command."""

    environment: dict[str, str]
    steps: list[str]
    n_installing: int


def github() -> Recipe:
    document = _read("github-actions.yml")
    (job,) = document["jobs"].values()
    runs = [step["run"] for step in job["steps"] if "run" in step]
    return _recipe(job["env"], runs)


def gitlab() -> Recipe:
    (job,) = _read("gitlab-ci.yml").values()
    return _recipe(job["variables"], [*job["before_script"], *job["script"], *job["after_script"]])


def _recipe(environment: dict[str, Any], runs: list[str]) -> Recipe:
    steps = [run for run in runs if run.strip() != INSTALL]
    return Recipe(
        environment={name: str(value) for name, value in environment.items()},
        steps=steps,
        n_installing=len(runs) - len(steps),
    )


def _read(name: str) -> dict[str, Any]:
    document: dict[str, Any] = yaml.safe_load(Path(FOLDER, name).read_text(encoding="utf-8"))
    return document
