"""What came of a chaos run: every acknowledged file against its one right result."""

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psycopg
from psycopg.rows import dict_row

from tests.chaos.uploads import Receipt

ROWS = """
    SELECT s.id::text AS submission_id, m.name AS method, e.status, e.attempt, e.problems,
           e.n_poison_strikes + e.n_infrastructure_strikes AS n_strikes,
           extract(epoch FROM e.finished_at - s.submitted_at)::float AS took_s,
           (SELECT count(*) FROM leaderboard_auditevent a WHERE a.noun_id = e.id::text
             AND a.verb IN ('scored', 'rejected', 'system_error')) AS n_decisions,
           (SELECT json_object_agg(metric || '_' || ttc_range, value) FROM leaderboard_score c
             WHERE c.evaluation_id = e.id) AS scores,
           (SELECT count(*) FROM leaderboard_score c WHERE c.evaluation_id = e.id) AS n_scores
    FROM leaderboard_submission s JOIN leaderboard_method m ON m.id = s.method_id
    LEFT JOIN leaderboard_evaluation e ON e.submission_id = s.id
"""
FINAL = {"SCORED", "REJECTED", "SYSTEM_ERROR", "CANCELLED"}


@dataclass(frozen=True)
class Verdict:
    """The figures that a run is judged by; `reasons` says why, line by line."""

    n_uploads: int
    lost: int
    doubled: int
    stuck: int
    worst_s: float
    waits_s: Sequence[float]
    states: Mapping[str, int]
    most_attempts: int
    reasons: Sequence[str]

    def is_good(self, *, worst_allowed_s: float) -> bool:
        """Never stuck, never lost, never twice."""
        return not (self.lost or self.doubled or self.stuck) and self.worst_s <= worst_allowed_s


def n_open(connection: "psycopg.Connection[Any]") -> int:
    query = "SELECT count(*) FROM leaderboard_evaluation WHERE status IN ('QUEUED', 'RUNNING')"
    return int(connection.execute(query).fetchone()[0])  # type: ignore[index]  # count(*) has a row


def judge(
    receipts: Sequence[Receipt], *, n_uploads: int, connection: "psycopg.Connection[Any]", files: Path
) -> Verdict:
    """Compare the database and the folder of prediction files with the receipts."""
    with connection.cursor(row_factory=dict_row) as cursor:
        rows = cursor.execute(ROWS).fetchall()
    by_id: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        by_id.setdefault(row["submission_id"], []).append(row)
    reasons: dict[str, list[str]] = {"lost": [], "doubled": [], "stuck": []}
    for receipt in receipts:
        for kind, reason in _faults(receipt, by_id.get(receipt.submission_id, [])):
            reasons[kind].append(f"{kind}: {receipt.upload.name} ({receipt.submission_id}): {reason}")
    by_method = Counter(row["method"] for row in rows)
    for method, n in by_method.items():
        if n > 1:
            reasons["doubled"].append(f"doubled: {method}: {n} evaluations of one upload")
    for _ in range(n_uploads - len(receipts)):
        reasons["lost"].append("lost: an upload was never acknowledged")
    reasons["lost"] += faulty_files(files, connection=connection)
    waits_s = sorted(row["took_s"] for row in rows if row["took_s"] is not None)
    return Verdict(
        n_uploads=n_uploads,
        lost=len(reasons["lost"]),
        doubled=len(reasons["doubled"]),
        stuck=len(reasons["stuck"]),
        worst_s=max(waits_s, default=0.0),
        waits_s=waits_s,
        states=Counter(row["status"] for row in rows),
        most_attempts=max((row["attempt"] or 0 for row in rows), default=0),
        reasons=[reason for kind in reasons.values() for reason in kind],
    )


def faulty_files(folder: Path, *, connection: "psycopg.Connection[Any]") -> list[str]:
    """Kept prediction files that are not the bytes of their digest, and digests of rows without a file."""
    kept = {path.stem: path for path in folder.rglob("*.json")}
    rows = connection.execute("SELECT digest FROM leaderboard_submission").fetchall()
    lacking = {str(digest).removeprefix("sha256:") for (digest,) in rows} - kept.keys()
    partial = [d for d, path in kept.items() if hashlib.sha256(path.read_bytes()).hexdigest() != d]
    return [*(f"lost: the file {d}" for d in lacking), *(f"lost: half of the file {d}" for d in partial)]


def _faults(receipt: Receipt, rows: Sequence[dict[str, Any]]) -> list[tuple[str, str]]:
    """What is wrong with one acknowledged upload, as (kind, reason)."""
    if not rows:
        return [("lost", "it was acknowledged, and is not in the database")]
    row, upload = rows[0], receipt.upload
    faults = []
    if row["status"] not in FINAL:
        return [("stuck", f"it is {row['status']} after {row['attempt']} attempts")]
    if row["n_decisions"] != 1:
        faults.append(("doubled", f"it was decided {row['n_decisions']} times"))
    if row["status"] != upload.state:
        faults.append(("lost", f"it is {row['status']}, the evaluator alone says {upload.state}"))
    elif row["status"] == "SCORED" and _flat(row["scores"]) != upload.scores:
        faults.append(("lost", f"its scores are {row['scores']}, the evaluator's {upload.scores}"))
    elif row["status"] == "REJECTED" and tuple(p["code"] for p in row["problems"]) != upload.problems:
        faults.append(("lost", f"its problems are {row['problems']}, the evaluator's {upload.problems}"))
    if row["status"] != "SCORED" and row["n_scores"]:
        faults.append(("doubled", f"it is {row['status']} and has {row['n_scores']} scores"))
    return faults


def _flat(scores: Mapping[str, float]) -> dict[str, float | None]:
    """Rows of scores under the names of the report."""
    return {name.removesuffix("_overall"): value for name, value in scores.items()}
