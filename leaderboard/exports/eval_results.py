"""Evaluation results of the Hugging Face Hub: what a model's repository has in `.eval_results/*.yaml`.

The format: https://huggingface.co/docs/hub/eval-results. An entry names a dataset of the Hub and a task in
it; without `hugging_face_id` in the file of the benchmark there are no entries.
"""

import json
from collections.abc import Iterable, Iterator

from django.conf import settings
from django.urls import reverse

from evaluator.scoring.results import format_rounded
from evaluator.tables.escaping import one_line
from leaderboard.boards.rows import Entry
from leaderboard.models import Edition, Visibility

_NO_DATASET = (
    "# This site names no dataset of the Hugging Face Hub; expected `hugging_face_id` in its benchmark.toml."
)
_ABOUT = "# For .eval_results/ in a model's repository on the Hugging Face Hub: keep the model's entry."


def is_configured() -> bool:
    """Whether the site names a dataset of the Hub."""
    return settings.BENCHMARK.dataset.hugging_face_id is not None


def lines(entries: Iterable[Entry], *, edition: Edition | None) -> Iterator[str]:
    """Write the file: an entry for each scored row of a public method, or a comment on why there is none."""
    yield _ABOUT if is_configured() else _NO_DATASET
    texts = [text for entry in entries for text in of_entry(entry, edition=edition)]
    yield from texts or ["[]"]


def of_entry(entry: Entry, *, edition: Edition | None) -> Iterator[str]:
    """Write the lines of one row with its first overall score; none where it is not public.

    A row under a pseudonym has none: the repository of its model would tell whose it is.
    """
    is_public = entry.kind == "submission" and entry.visibility == Visibility.PUBLIC
    if edition is None or entry.value is None or not is_public or not is_configured():
        return
    metric, dataset = edition.rules.primary, settings.BENCHMARK.dataset
    task = dataset.hugging_face_task.replace("{split}", edition.split_id)
    facts = f"{edition.split_id}, edition {edition.number}, protocol {edition.protocol}"
    members = {
        "dataset": {"id": dataset.hugging_face_id, "task_id": task},
        "value": float(format_rounded(entry.value, decimals=entry.decimals)),
        "date": f"{entry.date:%Y-%m-%d}",
        "source": {
            "url": settings.SITE_URL + reverse("method", args=[entry.method_id]),
            "name": settings.BENCHMARK.site_name,
        },
        "notes": f"{facts}: {metric.heading}, lower is better",
    }
    yield f"# {one_line(entry.method)}, {one_line(entry.team)}"
    # Every document of JSON is one of YAML.
    for number, (member, content) in enumerate(members.items()):
        yield f"{'  ' if number else '- '}{member}: {json.dumps(content, ensure_ascii=False)}"
