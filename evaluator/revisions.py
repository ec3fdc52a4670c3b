"""What changed between two revisions of a ground truth."""

from __future__ import annotations

from dataclasses import dataclass

from evaluator.truth import GroundTruth


@dataclass(frozen=True, slots=True)
class Comparison:
    """Counts of sequences, told apart by their natural keys: only in the new, only in the old, in both with
    another time to contact."""

    n_added: int
    n_removed: int
    n_changed: int


def compare(old: GroundTruth, new: GroundTruth) -> Comparison:
    """Count what `new` adds, removes and changes. No value is told.

    >>> import tempfile, pathlib
    >>> from evaluator import read_truth
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> head = "anno_id,bag_stamp,cam_id,ts,track_id,ttc"
    >>> _ = (folder / "a.csv").write_text(f"{head}\\n0,b,1,5,1,2.0\\n1,b,1,6,1,3.0\\n")
    >>> _ = (folder / "b.csv").write_text(f"{head}\\n0,b,1,6,1,3.5\\n1,b,1,7,1,4.0\\n")
    >>> compare(read_truth(folder / "a.csv"), read_truth(folder / "b.csv"))
    Comparison(n_added=1, n_removed=1, n_changed=1)
    """
    before = dict(zip(old.manifest.natural_keys, old.ttc_s.tolist(), strict=True))
    after = dict(zip(new.manifest.natural_keys, new.ttc_s.tolist(), strict=True))
    common = before.keys() & after.keys()
    n_changed = sum(before[key] != after[key] for key in common)
    return Comparison(len(after) - len(common), len(before) - len(common), n_changed)
