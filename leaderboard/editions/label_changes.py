"""Changes of labels, recording by recording, before a correction is kept; as private as the values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import evaluator
from evaluator.predictions.revisions import Comparison, compare, rows_in
from leaderboard.editions import ground_truth
from leaderboard.errors.refusals import Refused
from leaderboard.models import Edition, Split
from leaderboard.storage import truth_values

COLUMNS = (
    *("recording", "n_added", "n_removed", "n_changed"),
    *("largest_change_s", "mean_change_s", "n_sign_changed"),
)


@dataclass(frozen=True)
class LabelChanges:
    """The differences between a file and a board, and the recordings with any, greatest first."""

    edition: Edition
    counts: Comparison
    recordings: Sequence[Mapping[str, object]]


def load(*, split_name: str, path: Path) -> LabelChanges:
    """Compare a ground truth with that of the board; keep nothing.

    Raises `evaluator.Rejected`, `Refused` if the split has no board, `OSError` if its values are not here.
    """
    split = Split.objects.select_related("current_edition__ground_truth").filter(name=split_name).first()
    if split is None or split.current_edition is None:
        raise Refused(
            "edition-refused", f"The split {split_name!r} has no published edition to compare with."
        )
    new = evaluator.read_truth(path)
    ground_truth.require_openable(split, new)
    old = truth_values.load(split.current_edition.ground_truth_id)
    return LabelChanges(split.current_edition, compare(old, new), _by_recording(old, new))


def _by_recording(old: evaluator.GroundTruth, new: evaluator.GroundTruth) -> list[dict[str, Any]]:
    """Make a row for each recording with any change; times in seconds."""
    rows = rows_in(old.manifest, new.manifest)
    is_common = rows >= 0
    # Sequences that the new one has are named by it, the others by the old one.
    names = np.asarray(new.manifest.bag_stamp).astype(str)
    gone = np.ones(old.n_sequences, dtype=bool)
    gone[rows[is_common]] = False
    names_gone = np.asarray(old.manifest.bag_stamp).astype(str)[gone]
    before = np.full(new.n_sequences, np.nan)
    before[is_common] = old.ttc_s[rows[is_common]]
    change_s = np.where(is_common, np.abs(new.ttc_s - before), 0.0)
    changes = []
    for name in sorted({*names.tolist(), *names_gone.tolist()}):
        here = names == name
        changed = here & is_common & (change_s > 0)
        n_added, n_removed = int(np.sum(here & ~is_common)), int(np.sum(names_gone == name))
        if n_added or n_removed or changed.any():
            changes.append(
                {
                    "recording": name,
                    "n_added": n_added,
                    "n_removed": n_removed,
                    "n_changed": int(np.sum(changed)),
                    "largest_change_s": round(float(np.max(change_s[changed], initial=0.0)), 6),
                    "mean_change_s": round(float(np.mean(change_s[changed])), 6) if changed.any() else 0.0,
                    "n_sign_changed": int(np.sum(changed & (np.sign(new.ttc_s) != np.sign(before)))),
                }
            )
    return sorted(
        changes,
        key=lambda row: (-row["n_added"] - row["n_removed"], -row["largest_change_s"], row["recording"]),
    )
