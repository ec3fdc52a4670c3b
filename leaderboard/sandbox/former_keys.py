"""Unknown keys of a rejected file that belong to sequences of another edition: the problem names it."""

from dataclasses import replace

from evaluator import Problem, Rejected
from leaderboard.models import Edition, SentFile
from leaderboard.storage import manifests

# Each costs the reading of a manifest.
MAX_MANIFESTS = 5


def explained(rejected: Rejected, *, file: SentFile, edition: Edition) -> Rejected:
    """Say of unknown keys which published edition of the split has them. Raises `OSError` of the store.

    Manifests of published editions are public, and nothing else is looked at.
    """
    problems = [_explained(problem, file=file, edition=edition) for problem in rejected.problems]
    return Rejected(problems, n_problems=rejected.n_problems)


def _explained(problem: Problem, *, file: SentFile, edition: Edition) -> Problem:
    key = problem.where.rpartition("/")[2].replace("~1", "/").replace("~0", "~")
    if problem.code != "unknown-keys" or not key:
        return problem
    rows = Edition.objects.filter(split=edition.split_id).exclude(published_at=None).order_by("number")
    published = list(rows.values_list("number", "ground_truth__manifest_digest"))
    others = dict.fromkeys(digest for _, digest in reversed(published) if digest != file.manifest_digest)
    for digest in list(others)[:MAX_MANIFESTS]:
        manifest = manifests.load(digest)
        if key in manifest.row_of_natural_key or key in manifest.row_of_id:
            return replace(problem, message=f"{problem.message} {_sentence(digest, published)}")
    return problem


def _sentence(digest: str, published: list[tuple[int, str]]) -> str:
    had = max(number for number, each in published if each == digest)
    removed_by = next((number for number, _ in published if number > had), None)
    if removed_by is None:
        return f"The first of these keys is in the manifest of edition {had}, which is not the current one."
    return (
        f"The first of these keys was in the manifest until edition {had}: edition {removed_by} removed it. "
        "Use the keys of the current manifest."
    )
