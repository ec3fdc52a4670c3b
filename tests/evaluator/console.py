"""Runs the console examples of documents, so that what they show is what the command prints.

`python -m tests.evaluator.console` writes the present output into them; read the difference afterwards.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from evaluator.protocol import SCORE_NAMES
from tests.evaluator.recorded_site import RecordedSite, Reply, problem

REPOSITORY = Path(__file__).resolve().parents[2]
EXAMPLES = REPOSITORY / "examples"
DOCUMENTS = (REPOSITORY / "docs" / "cli.md", EXAMPLES / "README.md")

ID = "1f0c6a2e-6d0b-4f3e-9c55-0d4f2b8f3a11"
REJECTED_ID = "8c1e2b9a-3f47-4d0c-a6e1-5b7d90c2e4f6"

Run = Callable[[str], str]

_BLOCK = re.compile(r"(?<=^```console\n).*?(?=^```$)", re.MULTILINE | re.DOTALL)
_COMMAND = re.compile(r"^\$ .*(?:\\\n.*)*$", re.MULTILINE)


def recorded(text: str, run: Run) -> str:
    """`text` with the output below every `$ command` of its console blocks replaced by what it prints now.

    >>> print(recorded("```console\\n$ echo hello\\nbye\\n```\\n", lambda command: command + "!\\n"), end="")
    ```console
    $ echo hello
    echo hello!
    ```
    """
    return _BLOCK.sub(lambda block: _recorded_block(block[0], run), text)


def _recorded_block(block: str, run: Run) -> str:
    shown = []
    for command in _COMMAND.findall(block):
        output = run(command.removeprefix("$ "))
        shown.append(f"{command}\n{output}")
    return "".join(shown)


@contextmanager
def shell(tsttc: list[str], environment: Mapping[str, str]) -> Iterator[Run]:
    """Runs commands in a copy of examples/, where `tsttc` is the given program; gives what they print."""
    with tempfile.TemporaryDirectory() as folder:
        work, programs = Path(folder, "examples"), Path(folder, "bin")
        shutil.copytree(EXAMPLES, work)
        programs.mkdir()
        program = programs / "tsttc"
        program.write_text(f'#!/bin/sh\nexec {" ".join(tsttc)} "$@"\n')
        program.chmod(0o755)
        surroundings = {**os.environ, **environment, "PATH": f"{programs}:{os.environ['PATH']}"}

        def run(command: str) -> str:
            return subprocess.run(
                ["bash", "-c", command],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                check=False,
                cwd=work,
                env=surroundings,
                timeout=60,
            ).stdout

        yield run


@contextmanager
def documented_shell() -> Iterator[Run]:
    """A shell in which the checkout's own `tsttc` speaks to a server that gives the documented answers."""
    with RecordedSite() as site:
        put_documented_answers(site)
        environment = {
            "TSTTC_URL": site.url,
            "TSTTC_TOKEN": "tsttc_" + "0" * 64,
            "PYTHONPATH": str(REPOSITORY),
        }
        with shell([sys.executable, "-m", "evaluator"], environment) as run:
            yield run


def put_documented_answers(site: RecordedSite) -> None:
    """A leaderboard on which one submission is scored, one is rejected, and one quota is used up."""
    submission: dict[str, Any] = {
        "id": ID,
        "state": "QUEUED",
        "split": "val",
        "method": "Foo++",
        "url": f"https://leaderboard.example.org/submissions/{ID}/",
        "queue": {"ahead": 2, "estimate_s": 4.0},
        "scores": None,
        "counts": None,
        "n_out_of_range": None,
        "truncated": {},
        "problems": [],
        "n_problems": 0,
    }
    values = [13.92, 26.11, 15.02, 10.71, 13.18, 11.84, 6.21, 8.39, 12.77, 14.36]
    scores = dict(zip(SCORE_NAMES, values, strict=True))
    scored = submission | {
        "state": "SCORED",
        "queue": None,
        "scores": scores,
        "counts": {"overall": 28_600, "crucial": 3_832, "small": 3_775, "large": 12_470, "negative": 8_523},
        "n_out_of_range": 458,
        "truncated": {"-20": 171, "-0.15": 0, "0.05": 0, "20": 302},
    }
    faults = [
        ("missing-keys", "2 sequences have no value: 17, 41; expected one for each of 28,600.", "/17"),
        ("zero", "The value is 0; expected a time to contact other than 0.", "/8"),
    ]
    rejected = submission | {
        "id": REJECTED_ID,
        "state": "REJECTED",
        "queue": None,
        "problems": [{"code": code, "message": words, "where": where} for code, words, where in faults],
        "n_problems": 3,
    }
    site.put("POST /api/v1/submissions", Reply(submission, status=201))
    running = submission | {"state": "RUNNING", "queue": None}
    site.put(f"GET /api/v1/submissions/{ID}", Reply(submission), Reply(running), Reply(scored))
    site.put(f"GET /api/v1/submissions/{REJECTED_ID}", Reply(rejected))
    site.put("GET /api/v1/splits/test/board", Reply(published_board("test", scores)))
    site.put("GET /api/v1/splits/val/board", Reply(published_board("val", scores)))
    unknown = problem("There is nothing at this address that you may see.", code="not-found")
    site.put("GET /api/v1/splits/trial/board", Reply(unknown, status=404))


def published_board(split: str, scores: Mapping[str, float]) -> dict[str, object]:
    """The paper's five baselines and one submission, by rank."""
    paper = json.loads((REPOSITORY / "leaderboard" / "published" / "tsttc-2023.json").read_text())
    names = {method["slug"]: method["name"] for method in paper["methods"]}
    entries: list[dict[str, Any]] = [
        {
            "method": names[slug],
            "team": ", ".join(paper["source"]["authors"].split(", ")),
            "date": str(paper["source"]["year"]),
            "kind": "published",
            "scores": dict(zip(paper["columns"], values, strict=True)),
        }
        for slug, values in paper["results"][split].items()
    ]
    entries.append(
        {"method": "Foo++", "team": "TJU-V", "date": "2026-11-20", "kind": "submission", "scores": scores}
    )
    entries.sort(key=lambda entry: entry["scores"]["mid"])
    ranked = [{"rank": rank, **entry} for rank, entry in enumerate(entries, start=1)]
    return {"split": split, "edition": 2, "updated_at": "2026-11-20T12:00:00Z", "entries": ranked}


def main() -> None:
    """Write the present output into every document."""
    for document in DOCUMENTS:
        with documented_shell() as run:
            document.write_text(recorded(document.read_text(), run))


if __name__ == "__main__":
    main()
