"""Editions for tests: corrected ground truth, and the verbs with their usual arguments."""

import json
from pathlib import Path
from typing import Any

from django.contrib.auth.models import AnonymousUser
from django.utils import timezone

from evaluator import GroundTruth, evaluate, read_manifest, read_predictions, rounded
from evaluator.metrics.protocol import SCORE_NAMES
from leaderboard.boards import listing
from leaderboard.editions import corrections, splits
from leaderboard.models import (
    Edition,
    Publication,
    Split,
    Submission,
    User,
)
from leaderboard.storage import files

ANYBODY = AnonymousUser()
FACTORS = (1.05, 1.1, 1.2, 1.4)


def corrected(tmp_path: Path, *, drop: str = "", factor: float = 1.0, recording: str = "0001") -> Path:
    """The made-up truth without the recording `drop`, and another recording's values times `factor`."""
    lines = (tmp_path / "truth-test.csv").read_text().splitlines()
    kept = [lines[0]]
    for line in lines[1:]:
        fields = line.split(",")
        if fields[1] == drop:
            continue
        if fields[1] == recording:
            fields[5] = repr(float(fields[5]) * factor)
        kept.append(",".join(fields))
    path = tmp_path / f"corrected-{drop}-{factor}.csv"
    path.write_text("\n".join(kept) + "\n")
    return path


def extended(tmp_path: Path) -> Path:
    """The made-up truth with one sequence more, which no file has a value for."""
    path = tmp_path / "extended.csv"
    path.write_text((tmp_path / "truth-test.csv").read_text() + "900,0001,9,700000000,1,3.5\n")
    return path


def open_edition(
    path: Path | None = None, *, split: str = "test", actor: User | None = None, protocol: str | None = None
) -> Edition:
    return corrections.open_edition(
        split_name=split, path=path, protocol=protocol, now=timezone.now(), actor=actor
    )


def publish(edition: Edition, *, replaces: int | None = 1, leave_out: bool = False) -> Publication:
    return corrections.publish(
        edition=edition,
        reason="Labels corrected.",
        now=timezone.now(),
        actor=None,
        replaces=replaces,
        leave_out=leave_out,
    )


def roll_back(*, replaces: int = 2) -> Publication:
    return corrections.roll_back(
        split_name="test", reason="A mistake.", now=timezone.now(), actor=None, replaces=replaces
    )


def paper(slug: str = "later", *, split: str = "test", mid: float = 1.0) -> dict[str, Any]:
    """A document of one row that a paper prints, as docs/maintainers.md shows it."""
    method = {"slug": slug, "name": slug.title(), "description": "", "uses_nerf": False, "latency_ms": None}
    return {
        "source": {
            "title": "Later",
            "authors": "L. Ater",
            "year": 2026,
            "url": "https://example.org/later",
            "table": "Table 1",
            "code": "",
        },
        "columns": list(SCORE_NAMES),
        "methods": [method],
        "results": {split: {slug: [mid, *[10.0] * (len(SCORE_NAMES) - 1)]}},
    }


def quote(slug: str = "later", *, mid: float = 1.0) -> splits.Imported:
    """Put a row of a paper on the board of the test split, in place of any that it has by that name."""
    document = paper(slug, mid=mid)
    return splits.import_published(document=document, now=timezone.now(), is_replacing=True)


def board_now() -> listing.Board:
    split = Split.objects.select_related("current_edition__ground_truth").get(pk="test")
    return listing.board(split=split, viewer=ANYBODY)


def offline(submission: Submission, truth: GroundTruth, *, decimals: int = 1) -> dict[str, float | None]:
    """What the evaluator alone makes of the file's values, each for the sequence that it was sent for."""
    own = read_manifest(Path(files.store().path(files.manifest_name(submission.manifest_digest))))
    with files.opened_predictions(submission.digest) as kept:
        sent = read_predictions(kept.read(), manifest=own)
    ttc_s_by_key = dict(zip(own.natural_keys, sent.ttc_s.tolist(), strict=True))
    file = json.dumps({key: ttc_s_by_key[key] for key in truth.manifest.natural_keys}).encode()
    values = evaluate(read_predictions(file, manifest=truth.manifest), truth).flat()
    return {name: rounded(value, decimals=decimals) for name, value in values.items()}


def changed_on() -> str:
    """The day on which an edition last became the board."""
    return f"{Publication.objects.latest('pk').at:%Y-%m-%d}"
