"""What fields and parameters of the API mean, with an example each: the schema's words.

A serializer says by `help_text` what is peculiar to it. What means the same wherever it stands is here once,
by its name, or by shape and name where shapes differ. A test fails for a field without a description.
"""

from typing import Any, Final, NamedTuple

from evaluator.protocol import INTERVALS, METRICS


class Said(NamedTuple):
    """A description, and an example of the value."""

    text: str
    example: Any = None


UUID_EXAMPLE: Final = "0f8b1c2d-3e4f-4a5b-8c6d-7e8f9a0b1c2d"
DIGEST_EXAMPLE: Final = "sha256:" + "5de94cec" * 8
TIME_EXAMPLE: Final = "2026-11-21T10:00:00Z"

_RANGES: Final = {
    "overall": "all sequences",
    **{each.name: f"those with {each.low_s:g} s ≤ τ ≤ {each.high_s:g} s" for each in INTERVALS},
}
_METRICS: Final = {
    "mid": "Motion-in-depth error in 10⁻⁴",
    "rte": "Relative error of the time to contact in percent",
}
SCORES: Final[dict[str, Said]] = {
    metric if name == "overall" else f"{metric}_{name}": Said(
        f"{_METRICS[metric]}, the mean over {of}; smaller is better. Null: there are none.", 15.03
    )
    for metric in METRICS
    for name, of in _RANGES.items()
}
COUNTS: Final[dict[str, Said]] = {name: Said(f"How many: {of}.", 120) for name, of in _RANGES.items()}

EVERYWHERE: Final[dict[str, Said]] = {
    **SCORES,
    **COUNTS,
    "id": Said("A random id, for ever the same.", UUID_EXAMPLE),
    "split": Said("Name of the split.", "test"),
    "edition": Said("Number of the edition, the frame of a ranking.", 3),
    "protocol": Said("Name of the protocol, the rules by which files become numbers.", "tsttc-1"),
    "ground_truth": Said("Digest of the ground truth.", DIGEST_EXAMPLE),
    "manifest": Said("Digest of the public manifest.", DIGEST_EXAMPLE),
    "n_sequences": Said("Sequences in the ground truth.", 28600),
    "n_recordings": Said("Recordings that they come from.", 120),
    "method": Said("Name of the method.", "Deep Scale"),
    "method_id": Said("The method's id; null for a row printed in a paper.", UUID_EXAMPLE),
    "team": Said("Name of the team.", "Owls"),
    "description": Said("What its people say of it.", "Scale regression on six frames."),
    "paper_url": Said("Address of the paper.", "https://example.org/paper"),
    "code_url": Said("Address of the code.", "https://example.org/code"),
    "scores": Said("The ten published numbers; null before it is scored."),
    "counts": Said("Sequences that the numbers are the means over; null before it is scored."),
    "sort": Said("The column that the rows are sorted by; `-` before it reverses.", "rank"),
    "is_open": Said("Whether it takes submissions.", True),
    "opens_at": Said("Since when submissions are taken; null: since there is ground truth.", TIME_EXAMPLE),
    "closes_at": Said("Until when submissions are taken; null: without an end.", TIME_EXAMPLE),
    "title": Said("Its title, for people.", "Test"),
    "reason": Said("Why, in the words of whoever did it.", "Corrected labels of three recordings."),
    "detail": Said("What is wrong, what was found and what is expected, for people.", "The file has …"),
    "code": Said("A stable word for programs: docs/api.md lists all.", "quota-exceeded"),
    "limit": Said("Submissions that a team has within the window; null: any number.", 3),
    "left": Said("Submissions that are left of them; null: any number.", 2),
    "url": Said("Its page.", "https://leaderboard.example.org/"),
    "api_url": Said("Its address in this API.", f"https://leaderboard.example.org/…/{UUID_EXAMPLE}"),
    "is_named": Said("Whether the reader is told its name; if not, it is anonymous to them.", True),
    "details": Said("What its team says that it uses and costs."),
    # what a team says of a method; null or empty where nothing was said
    "n_frames": Said("Frames that the method looks at.", 6),
    "cameras": Said("Views of a scene that it takes.", "ONE"),
    "box_source": Said("Where it has the object's box from.", "GIVEN"),
    "uses_nerf": Said("Whether it was trained with NeRF data; null: not said.", False),
    "uses_extra_data": Said("Whether it was trained with further data; null: not said.", False),
    "pretraining": Said("What it was trained on before; empty: not said, or not shown.", "ImageNet"),
    "n_parameters": Said("Parameters of the model; null: not said.", 25_000_000),
    "latency_ms": Said("Milliseconds for one prediction; null: not said.", 12.5),
    "hardware": Said("What it was measured on; empty: not said, or not shown.", "one desktop GPU"),
    "visibility": Said("Who may see the method.", "PRIVATE"),
}

BY_SHAPE: Final[dict[str, dict[str, Said]]] = {
    "Board": {
        "edition": Said("Number of the edition that the board ranks; null: none is published.", 3),
        "updated_at": Said("When the newest row came, or the edition.", TIME_EXAMPLE),
        "entries": Said("The rows in the order asked for."),
    },
    "Edition": {"published_at": Said("When it first was the board.", TIME_EXAMPLE)},
    "Entry": {
        "rank": Said("By published MiD, ties share one; null: it has no value.", 1),
        "kind": Said("A submission scored here, or a row printed in a paper.", "submission"),
        "date": Said("The day it was sent; of a row in a paper, the year.", "2026-11-21"),
        "scores": Said("The ten published numbers."),
    },
    "Error": {
        "type": Said(
            "Address of what the site says of the code.",
            "https://leaderboard.example.org/docs/api/#problem-quota-exceeded",
        ),
        "title": Said("The status in words.", "Too Many Requests"),
        "status": Said("The HTTP status.", 429),
        "problems": Said("Each thing that is wrong."),
    },
    "Warning": {
        "code": Said("A stable word for programs: docs/file-format.md lists all.", "shuffled-values"),
        "message": Said("What was found and expected, and the probable cause, in a sentence or two."),
    },
    "NewSubmissionRequest": {
        "description": Said("What is said of the method; replaces what was said before.", "Six frames."),
        "paper_url": Said("Address of the method's paper (http or https).", "https://example.org/paper"),
        "code_url": Said("Address of the method's code (http or https).", "https://example.org/code"),
    },
    "Preview": {
        "replaces": Said("Number of the edition that it would take the place of.", 2),
        "n_added": Said(
            "Sequences that the ground truth has more than the board's; null if not compared.", 0
        ),
        "n_removed": Said("Sequences that it has no more.", 1),
        "n_renumbered": Said("Sequences that have another anno_id than before.", 0),
        "n_changed_sequences": Said("Sequences whose true value differs.", 12),
        "n_changed": Said("Submissions whose numbers change.", 40),
        "n_moved": Said("Submissions whose rank changes.", 4),
        "n_newly_rejected": Said("Submissions that it cannot score.", 0),
        "progress": Said("How far its scoring is."),
    },
    "Problem": {
        "message": Said(
            "What is wrong, found and expected, in the words of page and CLI.", "The value is 0; …"
        ),
        "where": Said(
            "Where: a JSON pointer into the file (`/predictions/12`), a position in it (`line 3, column 8`), "
            "the name of a field or parameter, or nothing.",
            "/predictions/12",
        ),
        "code": Said("A stable word for programs.", "zero"),
    },
    "Publication": {
        "at": Said("When.", TIME_EXAMPLE),
        "kind": Said("Forward to a new edition, or back to a former one.", "PUBLISHED"),
        "replaced": Said("Number of the edition whose place it took; null for the first.", 2),
    },
    "Queue": {
        "ahead": Said("Submissions that are scored before this one.", 4),
        "estimate_s": Said("Seconds until it is scored, from recent runs; null: unknown.", 12.5),
    },
    "Quota": {
        "rejected_limit": Said(
            "Rejected and cancelled files that are taken within 24 hours; null: any number.", 20
        ),
    },
    "Rescoring": {
        "n_total": Said("Submissions that it has to score.", 1000),
        "n_done": Said("Those that are decided.", 800),
        "n_waiting": Said("Those that wait or run.", 200),
        "n_scored": Said("Scored.", 790),
        "n_rejected": Said("Rejected: its ground truth cannot score the file.", 8),
        "n_cancelled": Said("Cancelled by their team.", 2),
        "percent": Said("The share that is decided, rounded down.", 80),
        "rate_per_s": Said("Decided per second lately; null: unknown.", 3.6),
        "left_s": Said("Seconds until all are; null: unknown.", 56.0),
    },
    "Revoked": {
        "detail": Said("The same sentence for every text.", "If that was a token of this leaderboard, …"),
    },
    "Split": {
        "description": Said("What it is, for people.", "The hidden test split."),
        "edition": Said("Number of the published edition; null: none yet.", 3),
        "is_hidden": Said("Whether its true values are hidden.", True),
        "is_simulated": Said("Whether its true values come from a simulation.", False),
    },
    "Submission": {
        "state": Said("Final are SCORED, REJECTED, SYSTEM_ERROR (our fault) and CANCELLED.", "SCORED"),
        "method_id": Said("The method's id.", UUID_EXAMPLE),
        "submitted_at": Said("When it was safely stored.", TIME_EXAMPLE),
        "started_at": Said("When its scoring began; null: not yet.", TIME_EXAMPLE),
        "finished_at": Said("When it was decided; null: not yet.", TIME_EXAMPLE),
        "is_final": Said("Whether its state will not change any more.", True),
        "fault_is_ours": Said("Whether scoring failed on our side, and says nothing of the file.", False),
        "size_bytes": Said("Size of the file.", 600_000),
        "note": Said("The team's own note.", "learning rate 1e-4"),
        "commit": Said("Commit of the code that made the file.", "0a1b2c3"),
        "queue": Said("Its place in the queue; null: it does not wait."),
        "n_out_of_range": Said("Sequences with |τ| > 20 s, in the overall means only.", 7),
        "truncated": Said("Predictions that the protocol moved to a boundary, by boundary.", {"20": 3}),
        "warnings": Said("What is probably wrong with a scored file; the file and its manifest say so."),
        "problems": Said("What is wrong with a rejected file, the first of each kind."),
        "n_problems": Said("How many faults it has, listed or not.", 0),
        "quota": Said("What the team has left after this submission."),
    },
}
# A submission that has just come in has the fields of every other.
SAME_AS: Final[dict[str, str]] = {"Submitted": "Submission"}

PARAMETERS: Final[dict[str, Said]] = {
    "split": Said("Name of the split.", "test"),
    "number": Said("Number of the edition.", 1),
    "submission_id": Said("The submission's id.", UUID_EXAMPLE),
    "method_id": Said("The method's id.", UUID_EXAMPLE),
    "team_id": Said("The team's id.", UUID_EXAMPLE),
}


def of(shape: str, name: str) -> Said | None:
    """What a field of a shape means; None if nobody said so."""
    return BY_SHAPE.get(SAME_AS.get(shape, shape), {}).get(name) or EVERYWHERE.get(name)
