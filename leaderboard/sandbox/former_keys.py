"""Keys of a rejected file that belong to sequences of another edition: the problem names the edition."""

from collections.abc import Callable
from dataclasses import replace

from django.conf import settings

from evaluator import Predictions, Problem, Rejected
from evaluator.predictions import former
from evaluator.predictions.former import MAX_MANIFESTS
from leaderboard.models import Edition, SentFile, Split
from leaderboard.sandbox import child
from leaderboard.storage import files, manifests

Published = list[tuple[int, str]]
"""The published editions of a split, by number, with the digests of their manifests."""


def explained(
    rejected: Rejected, *, file: SentFile, edition: Edition, heartbeat: Callable[[], bool]
) -> Rejected:
    """Say which published edition of the split has the keys of a file. Raises as `child.read_predictions`.

    If the file fits the manifest of such an edition, the first problem has the command that repairs it.
    Manifests of published editions are public, and nothing else is looked at.
    """
    if not any(problem.code in {"unknown-keys", "missing-keys"} for problem in rejected.problems):
        return rejected
    rows = Edition.objects.filter(split=edition.split_id).exclude(published_at=None).order_by("number")
    published = list(rows.values_list("number", "ground_truth__manifest_digest"))
    others = dict.fromkeys(digest for _, digest in reversed(published) if digest != file.manifest_digest)
    digests = list(others)[:MAX_MANIFESTS]
    problems = [_explained(problem, digests=digests, published=published) for problem in rejected.problems]
    worded = Rejected(problems, n_problems=rejected.n_problems)
    for digest in digests if former.is_of_keys(rejected) else ():
        predictions = _read(file, digest=digest, heartbeat=heartbeat)
        if predictions is not None:
            number = max(number for number, each in published if each == digest)
            return former.explained(worded, split=edition.split_id, edition=number, keys=predictions.keys)
    for name, digest in _other_splits(file, edition) if former.is_of_keys(rejected) else ():
        if _read(file, digest=digest, heartbeat=heartbeat) is not None:
            return former.of_another_split(worded, split=edition.split_id, other=name)
    return worded


def _other_splits(file: SentFile, edition: Edition) -> list[tuple[str, str]]:
    """Return the names of other splits on the site's pages, with the digests of their manifests."""
    rows = Split.objects.shown().exclude(pk=edition.split_id).exclude(current_edition=None)
    pairs = rows.values_list("pk", "current_edition__ground_truth__manifest_digest")
    return [(name, digest) for name, digest in pairs if digest != file.manifest_digest][:MAX_MANIFESTS]


def _read(file: SentFile, *, digest: str, heartbeat: Callable[[], bool]) -> Predictions | None:
    with files.opened_predictions(file.digest) as source:
        try:
            return child.read_predictions(
                source,
                digest=file.digest,
                manifest=manifests.load(digest),
                manifest_path=manifests.path(digest),
                heartbeat=heartbeat,
                heartbeat_s=settings.HEARTBEAT_S,
            )
        except (Rejected, child.ChildDied):
            return None


def _explained(problem: Problem, *, digests: list[str], published: Published) -> Problem:
    key = problem.where.rpartition("/")[2].replace("~1", "/").replace("~0", "~")
    if problem.code != "unknown-keys" or not key:
        return problem
    for digest in digests:
        manifest = manifests.load(digest)
        if key in manifest.row_of_natural_key or key in manifest.row_of_id:
            return replace(problem, message=f"{problem.message} {_sentence(digest, published)}")
    return problem


def _sentence(digest: str, published: Published) -> str:
    had = max(number for number, each in published if each == digest)
    removed_by = next((number for number, _ in published if number > had), None)
    if removed_by is None:
        return f"The first of these keys is in the manifest of edition {had}, which is not the current one."
    return (
        f"The first of these keys was in the manifest until edition {had}: edition {removed_by} removed it."
    )
