"""The splits that the benchmark has from the start, and the rows printed in papers."""

import json
from datetime import timedelta
from pathlib import Path
from typing import Any

from django.db import transaction

from leaderboard.models import PublishedResult, Split

PUBLISHED_DIR = Path(__file__).parent / "published"

SPLITS: tuple[dict[str, Any], ...] = (
    {
        "name": "test",
        "title": "Test",
        "description": "The hidden test set: the numbers that papers quote.",
        "position": 0,
        "is_hidden": True,
        "quota_limit": 3,
        "quota_window": timedelta(days=30),
        "quota_min_gap": timedelta(hours=24),
    },
    {
        "name": "val",
        "title": "Validation",
        "description": "The validation set, whose ground truth comes with the dataset.",
        "position": 1,
        "is_hidden": False,
        "quota_limit": 50,
    },
    {
        "name": "demo",
        "title": "Demo",
        "description": "A simulated set for trying things out. Its numbers mean nothing for the road.",
        "position": 2,
        "is_hidden": False,
        "is_simulated": True,
        "quota_limit": 20,
    },
)


def ensure_splits(*, split_model: Any = Split, result_model: Any = PublishedResult) -> None:
    """Make the three splits and the published rows where they are missing; change nothing that is there.

    A migration passes the models as they were in its time, without what came later.
    """
    columns = {field.name for field in split_model._meta.get_fields()}
    with transaction.atomic():
        for fields in SPLITS:
            there = {name: value for name, value in fields.items() if name in columns}
            split_model.objects.get_or_create(name=fields["name"], defaults=there)
        for path in sorted(PUBLISHED_DIR.glob("*.json")):
            _ensure_published(json.loads(path.read_text(encoding="utf-8")), result_model)


def _ensure_published(document: dict[str, Any], result_model: Any) -> None:
    """The rows of one paper's main table; see `leaderboard/published/` for the form."""
    source = document["source"]
    methods = {method["slug"]: method for method in document["methods"]}
    for split_name, rows in document["results"].items():
        for slug, values in rows.items():
            method = methods[slug]
            result_model.objects.get_or_create(
                split_id=split_name,
                slug=slug,
                defaults={
                    "method_name": method["name"],
                    "description": method["description"],
                    "authors": source["authors"],
                    "source_title": source["title"],
                    "source_url": source["url"],
                    "source_table": source["table"],
                    "code_url": source["code"],
                    "year": source["year"],
                    "uses_nerf": method["uses_nerf"],
                    "latency_ms": method["latency_ms"],
                    "hardware": "one RTX 3090, batch 1, FP16" if method["latency_ms"] else "",
                    "scores": dict(zip(document["columns"], values, strict=True)),
                },
            )
