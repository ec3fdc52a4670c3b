"""The recipes for CI as a runner reads them: their jobs' shell steps, in order."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from tests.journeys.production import REPOSITORY

FOLDER = REPOSITORY / "examples" / "ci"
ACTION = "./.github/actions/tsttc-submit"
PIN = re.compile(r"[\w-]+/[\w-]+@[0-9a-f]{40}")


@dataclass(frozen=True)
class Recipe:
    """The variables and the shell steps of a job, without what installs the command."""

    environment: dict[str, str]
    steps: list[str]
    n_installing: int


def github() -> Recipe:
    """The workflow, with the steps of the action in the place where it is used."""
    runs, environment = list[str](), dict[str, str]()
    for step in github_steps():
        if step.get("uses") != ACTION:
            runs += [step["run"]] if "run" in step else []
            continue
        action = _read("github/actions/tsttc-submit/action.yml")
        defaults = {name: each.get("default") for name, each in action["inputs"].items()}
        assert step["with"].keys() <= defaults.keys()
        for one in action["runs"]["steps"]:
            assert "${{" not in one["run"], "an input in a script would be run"
            runs.append(one["run"])
            environment |= {
                name: _filled(expression, defaults | step["with"]) for name, expression in one["env"].items()
            }
    return _recipe(environment, runs)


def github_steps() -> list[dict[str, Any]]:
    """The steps of the workflow."""
    (job,) = _read("github/workflows/leaderboard.yml")["jobs"].values()
    steps: list[dict[str, Any]] = job["steps"]
    return steps


def gitlab() -> Recipe:
    (job,) = _read("gitlab-ci.yml").values()
    return _recipe(job["variables"], [*job["before_script"], *job["script"], *job["after_script"]])


def _filled(expression: str, inputs: dict[str, Any]) -> str:
    return re.sub(r"\$\{\{ inputs\.([\w-]+) \}\}", lambda match: str(inputs[match[1]]), expression)


def _recipe(environment: dict[str, Any], runs: list[str]) -> Recipe:
    steps = [run for run in runs if '"tsttc @ $TSTTC_SOURCE"' not in run]
    return Recipe(
        environment={name: str(value) for name, value in environment.items()},
        steps=steps,
        n_installing=len(runs) - len(steps),
    )


def _read(name: str) -> dict[str, Any]:
    document: dict[str, Any] = yaml.safe_load(Path(FOLDER, name).read_text(encoding="utf-8"))
    return document
