"""Files that fit the manifest of an earlier edition: what to do is said in the same words everywhere."""

# Whoever removes the unknown keys of such a file, or adds the missing ones, has a file without a problem.
# With anno_ids, most of its values then belong to other sequences.

from __future__ import annotations

from dataclasses import replace
from typing import Final

from evaluator.problems import Problem, Rejected
from evaluator.truth.ground_truth import KeyKind

MAX_MANIFESTS: Final = 5
"""So many manifests of other editions are tried, the latest first."""

_CODES: Final = ("unknown-keys", "missing-keys")


def is_of_keys(rejected: Rejected) -> bool:
    """Say whether the file has other keys than the manifest, and no other problem."""
    return all(problem.code in _CODES for problem in rejected.problems)


def of_another_split(rejected: Rejected, *, split: str, other: str) -> Rejected:
    """Add to the first problem that the file fits the manifest of another split."""
    first, *rest = rejected.problems
    sentence = (
        f'The file fits the split "{other}", and was sent to "{split}". Send it to "{other}", or make a file '
        f'for the manifest of "{split}".'
    )
    problem: Problem = replace(first, message=f"{first.message} {sentence}")
    return Rejected([problem, *rest], n_problems=rejected.n_problems)


def explained(rejected: Rejected, *, split: str, edition: int, keys: KeyKind) -> Rejected:
    """Add to the first problem that the file fits the manifest of this edition, with the command for it."""
    sentence = advice(split=split, edition=edition, keys=keys)
    first, *rest = rejected.problems
    problem: Problem = replace(first, message=f"{first.message} {sentence}")
    return Rejected([problem, *rest], n_problems=rejected.n_problems)


def advice(*, split: str, edition: int, keys: KeyKind) -> str:
    """Say what a file that fits the manifest of this edition needs."""
    begin = f"The file fits the manifest of edition {edition}, which is not the current one."
    new = f"tsttc manifest --split {split} -o new.csv"
    if keys == "natural_key":
        return (
            f"{begin} To leave out the sequences that the current manifest lacks, run: {new} && "
            "tsttc convert FILE --to-manifest new.csv -o OUT"
        )
    return (
        f"{begin} Its anno_ids can name other sequences now: do not remove or add keys. To write natural "
        "keys, run: "
        f"tsttc manifest --split {split} --edition {edition} -o old.csv && {new} && "
        "tsttc convert FILE --manifest old.csv --to-manifest new.csv -o OUT"
    )
