"""The examples of the API reference, sent for real; `python -m tests.api_examples` records their answers."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any

from django.core.files.uploadedfile import SimpleUploadedFile
from django.test import Client

from leaderboard.web.docs import api_examples
from leaderboard.web.docs.api_examples import EXAMPLES, Call

ANSWERS = Path(api_examples.__file__).with_name("api_answers.json")
RECORD = "TSTTC_RECORD_EXAMPLES"
# What differs from one run to the next, and what stands for it.
MOMENT = "2026-11-21T10:00:00Z"
TIMES = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(?:\.\d+)?(?:Z|\+00:00)")
UUIDS = re.compile(r"[0-9a-f]{8}-[0-9a-f]{4}-4[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}")
DAYS = re.compile(r"\b20[23]\d-\d\d-\d\d\b(?!T)")
PSEUDONYM = re.compile(r"Anonymous [0-9a-f]{6}")
MEASURED = {"rate_per_s": 3.6}
HEADERS = ("Location", "Link")
MAX_LINES = 4
MAX_WIDTH = 200


def answers(
    clients: Mapping[str, Client], known: Mapping[str, str], *, file: bytes, prepare: Callable[[str], None]
) -> dict[str, Any]:
    """Send every example in its order. `known` maps ids of this run to those of the examples."""
    answers_by_name = {}
    for name, example in EXAMPLES.items():
        prepare(name)
        answers_by_name[name] = {
            "answer": send(example.call, clients[example.by], known, file=file),
            "refused": send(example.refused, clients[example.by], known, file=file),
        }
    return answers_by_name


def send(call: Call, client: Client, known: Mapping[str, str], *, file: bytes) -> dict[str, Any]:
    """What a request is answered, with the examples' ids in it."""
    real = {example: mine for mine, example in known.items()}
    target = UUIDS.sub(lambda match: real.get(match[0], match[0]), call.target)
    headers = {"Authorization": client.headers_of_token["Authorization"]} if call.has_token else {}  # type: ignore[attr-defined]
    if call.has_token and call.bearer != Call.bearer:
        headers = {"Authorization": f"Bearer {call.bearer}"}
    options: dict[str, Any] = {"headers": headers}
    if call.body is not None:
        options |= {"data": json.dumps(call.body), "content_type": "application/json"}
    elif call.form is not None:
        parts: dict[str, Any] = dict(call.form)
        if call.has_file:
            parts["file"] = SimpleUploadedFile("predictions.json", file, "application/json")
        options["data"] = parts
    response = getattr(client, call.method.lower())(target, **options)
    is_json = "json" in response.headers.get("Content-Type", "")
    body = response.getvalue().decode() if response.streaming else response.text
    if response.headers.get("Content-Type") == "application/jwt":
        body = f"{body[:20]}…"  # the rest is another one each time
    shown = {name: response.headers[name] for name in HEADERS if name in response.headers}
    return {
        "status": f"{response.status_code} {HTTPStatus(response.status_code).phrase}",
        "headers": {name: stood_for(text, known) for name, text in shown.items()},
        "body": shortened(json.loads(stood_for(body, known))) if is_json else first_lines(body),
    }


def stood_for(text: str, known: Mapping[str, str]) -> str:
    """Replace what differs between runs by fixed text."""
    text = UUIDS.sub(lambda match: known.get(match[0], api_examples.NOBODYS), text)
    text = DAYS.sub(MOMENT[:10], TIMES.sub(MOMENT, text))
    return PSEUDONYM.sub("Anonymous 16fd27", text)


def shortened(value: Any, name: str = "") -> Any:
    """A document whose long lists end after their first member, with the number of the others."""
    if name in MEASURED and value is not None:
        return MEASURED[name]
    if isinstance(value, dict):
        return {key: shortened(each, key) for key, each in value.items()}
    if isinstance(value, list) and len(value) > 1 and isinstance(value[0], dict | list):
        return [shortened(value[0]), f"… {len(value) - 1} more"]
    return [shortened(each) for each in value] if isinstance(value, list) else value


def first_lines(text: str) -> str:
    """The beginning of a table, or of a file."""
    lines = [f"{line[:MAX_WIDTH]} …" if len(line) > MAX_WIDTH else line for line in text.splitlines()]
    if len(lines) <= MAX_LINES:
        return "\n".join([*lines, *[""] * text.endswith("\n")])
    return "\n".join([*lines[:MAX_LINES], f"… {len(lines) - MAX_LINES} more lines"])


def main() -> None:
    """Record them, by the test that compares them."""
    test = "tests/leaderboard/web/docs/test_api_examples.py"
    command = [sys.executable, "-m", "pytest", "-q", test, "-k", "recorded"]
    subprocess.run(command, env=os.environ | {RECORD: "1"}, check=True)


if __name__ == "__main__":
    main()
