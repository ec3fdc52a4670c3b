"""Run the console examples of documents, so that they show what the command prints.

`python -m tests.evaluator.cli.console` writes the present output into them; read the difference afterwards.
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

from evaluator import receipts
from evaluator.metrics.protocol import PROTOCOLS, SCORE_NAMES
from evaluator.papers.tables import published_tables
from tests.evaluator.cli.recorded_site import RecordedSite, Reply
from tests.evaluator.worlds import EXAMPLES, REPOSITORY

DOCUMENTS = (REPOSITORY / "docs" / "cli.md", EXAMPLES / "README.md")

ID = "1f0c6a2e-6d0b-4f3e-9c55-0d4f2b8f3a11"
REJECTED_ID = "8c1e2b9a-3f47-4d0c-a6e1-5b7d90c2e4f6"

METHOD_ID = "5d2c1f8e-0b7a-4c36-9f41-7a3e6b9d2c10"

Run = Callable[[str], str]

# A hidden split has one decimal and no warning error, an open one has two decimals and the warning error.
ON_TEST = [13.9, 26.1, 15.0, 10.7, 13.2, 11.8, 6.2, 8.4, 12.8, 14.4]
ON_VAL = [13.92, 26.11, 15.02, 10.71, 13.18, 11.84, 6.21, 8.39, 12.77, 14.36, 2.95, 12.84, 5.91, 0.42, 0.88]
OPEN = PROTOCOLS["tsttc-2"]
COUNTS = {"overall": 28_600, "crucial": 3_832, "small": 3_775, "large": 12_312, "negative": 8_223}
_SEED = bytes(range(32))  # of a key that signs nothing but this example
RECEIPT_KEYS = receipts.key_set([receipts.public_key(_SEED)])
RECEIPT = receipts.sign(
    {
        "site": "https://leaderboard.example.org",
        "submission": ID,
        "split": "test",
        "edition": 2,
        "protocol": "tsttc-1",
        "ground_truth": "sha256:" + "9f" * 32,
        "file": "sha256:" + "1c" * 32,
        "method": {"id": METHOD_ID, "name": "Foo++"},
        "scores": {name: f"{value:.1f}" for name, value in zip(SCORE_NAMES, ON_TEST, strict=True)},
        "counts": COUNTS,
        "scored_at": "2026-11-20T12:00:00Z",
    },
    private_key=_SEED,
)

_BLOCK = re.compile(r"(?<=^```console\n).*?(?=^```$)", re.MULTILINE | re.DOTALL)
_COMMAND = re.compile(r"^\$ .*(?:(?<=\\)\n.*)*$", re.MULTILINE)


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
        Path(work, "tsttc-receipt-keys.json").write_text(json.dumps(RECEIPT_KEYS))
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
                timeout=180,
            ).stdout

        yield run


@contextmanager
def documented_shell() -> Iterator[Run]:
    """A shell in which the checkout's own `tsttc` speaks to a server that gives the documented answers."""
    with RecordedSite() as site, tempfile.TemporaryDirectory() as home:
        put_documented_answers(site)
        put_more_documented_answers(site)
        environment = {
            "TSTTC_URL": site.url,
            "TSTTC_TOKEN": "tsttc_" + "0" * 64,
            "PYTHONPATH": str(REPOSITORY),
            "PYTHON_KEYRING_BACKEND": "keyring.backends.fail.Keyring",
            "XDG_CONFIG_HOME": home,
        }
        with shell([sys.executable, "-m", "evaluator"], environment) as run:
            yield run


def put_documented_answers(site: RecordedSite) -> None:
    """A leaderboard on which one submission is scored, one is rejected, and one quota is used up."""
    submission: dict[str, Any] = {
        "id": ID,
        "state": "QUEUED",
        "split": "test",
        "method": "Foo++",
        "visibility": "PRIVATE",
        "method_id": METHOD_ID,
        "url": f"https://leaderboard.example.org/submissions/{ID}/",
        "queue": {"ahead": 2},
        "scores": None,
        "counts": None,
        "n_out_of_range": None,
        "truncated": {},
        "problems": [],
        "n_problems": 0,
    }
    on_test = dict(zip(SCORE_NAMES, ON_TEST, strict=True))
    unranked = {"rank_low": None, "rank_high": None, "is_with_best": None}  # as of every private method
    scored = submission | {
        "state": "SCORED",
        "queue": None,
        "scores": on_test,
        "decimals": 1,
        "intervals": {
            "mid": {"low": 13.2, "high": 14.6, **unranked},
            "rte": {"low": 11.1, "high": 12.6, **unranked},
        },
        "awaits_intervals": False,
        "rank": 1,
        "counts": COUNTS,
        "n_out_of_range": 458,
        "truncated": {"-20": 171, "-0.15": 0, "0.05": 0, "20": 302},
    }
    faults = [
        (
            "missing-keys",
            "2 sequences have no value: 17, 41; expected one for each of the manifest's 28,600 sequences, "
            "by anno_id.",
            "/17",
        ),
        ("zero", "The value is 0; expected a time to contact other than 0, negative when moving away.", "/8"),
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
    site.put("GET /api/v1/splits/test/board", Reply(published_board("test", on_test)))
    on_val = dict(zip(OPEN.score_names, ON_VAL, strict=True))
    site.put("GET /api/v1/splits/val/board", Reply(published_board("val", on_val)))


def put_more_documented_answers(site: RecordedSite) -> None:
    """Add quotas, a comparison, a receipt and a split with a manifest to the same leaderboard."""
    window_s = 30 * 86400.0
    quotas = [
        {"split": "val", "limit": 50, "used": 2, "left": 48, "next_slot_at": None, "is_open": True},
        {"split": "test", "limit": 3, "used": 3, "left": 0, "is_open": False, "window_s": window_s}
        | {
            "next_slot_at": "2026-12-04T09:13:00Z",
            "sentence": "Your team has used 3 submissions to Test, its quota for 30 days; the next slot "
            "opens at 2026-12-04 09:13 UTC.",
        },
    ]
    site.put("GET /api/v1/quota", Reply(quotas))
    table = (EXAMPLES / "manifest.csv").read_bytes()
    site.put("GET /api/v1/splits/demo/manifest", Reply(table, headers={"Content-Type": "text/csv"}))
    significant = {"difference": -1.18, "low": -1.73, "high": -0.62, "p": 0.0004}
    differences = {
        name: significant
        if name in {"mid", "mid_crucial", "rte"}
        else significant | {"low": -2.9, "high": 0.54, "p": 0.17}
        for name in OPEN.score_names
    }
    sentence = (
        "The MiD of Foo++ is 1.18 lower than that of Bar "
        "(95% confidence interval: 0.62 to 1.73 lower; p = 0.0004)."
    )
    compared = {"split": "val", "edition": 2, "is_complete": True, "reason": "", "entries": []}
    pair = {"differences": differences, "sentence": sentence}
    site.put("GET /api/v1/compare", Reply(compared | {"pairs": [pair]}))
    site.put(f"GET /api/v1/submissions/{ID}/receipt", Reply(RECEIPT.encode()))
    moved = {"id": ID, "state": "SCORED", "split": "test", "method": "Foo++"}
    site.put(f"POST /api/v1/submissions/{ID}/move", Reply(moved))
    site.put("GET /api/v1/methods", Reply([]))


def published_board(split: str, scores: Mapping[str, float]) -> dict[str, object]:
    """The paper's five baselines and one submission, by rank."""
    source = REPOSITORY / "leaderboard" / "editions" / "published" / "tsttc-2023.json"
    paper = json.loads(source.read_text())
    names = {method["slug"]: method["name"] for method in paper["methods"]}
    table = published_tables().table(paper["results_of"])
    entries: list[dict[str, Any]] = [
        {
            "method": names[row.method],
            "team": ", ".join(paper["source"]["authors"].split(", ")),
            "date": str(paper["source"]["year"]),
            "kind": "published",
            "decimals": 1,
            "scores": dict(zip(table.columns, row.values, strict=True)),
        }
        for row in table.rows
        if row.split == split
    ]
    entries.append(
        {"method": "Foo++", "team": "TJU-V", "date": "2026-11-20", "kind": "submission", "scores": scores}
        | {"decimals": 1 if split == "test" else 2, "method_id": METHOD_ID}
    )
    if split == "val":
        worse = {name: round(value + 1.18, 2) for name, value in scores.items()}
        row = {"method": "Bar", "team": "Owls", "date": "2026-11-18", "kind": "submission", "scores": worse}
        entries.append(row | {"decimals": 2, "method_id": REJECTED_ID})
    entries.sort(key=lambda entry: entry["scores"]["mid"])
    ranked = [{"rank": rank, **entry} for rank, entry in enumerate(entries, start=1)]
    return {
        "split": split,
        "edition": 2,
        "protocol": "tsttc-1" if split == "test" else OPEN.name,
        "ground_truth": "sha256:" + "9f" * 32,
        "n_sequences": COUNTS["overall"],
        "n_recordings": 120,
        "updated_at": "2026-11-20T12:00:00Z",
        "entries": ranked,
    }


def main() -> None:
    """Write the present output into every document."""
    for document in DOCUMENTS:
        with documented_shell() as run:
            document.write_text(recorded(document.read_text(encoding="utf-8"), run), encoding="utf-8")


if __name__ == "__main__":
    main()
