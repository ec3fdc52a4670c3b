"""Many submissions at once, past the doors, for tests and benchmarks of what becomes of them later.

`python -m tests.crowd SPLIT N` makes N submissions in the database that the environment names, each of
another method, with their values kept as a worker keeps them, and queues them for the published edition as
the re-scoring of an edition is queued.
"""

import os
import sys

import numpy as np

import evaluator

METHODS_OF_A_TEAM = 10


def method_name(number: int) -> str:
    """What the method of the submission `number` is called."""
    return f"Method {number}"


def predictions(truth: evaluator.GroundTruth, number: int) -> evaluator.Predictions:
    """Made-up predictions; the same number gives the same values again."""
    rng = np.random.default_rng([20230901, number])
    ttc_s = truth.ttc_s * np.exp(rng.normal(0.0, 0.2, truth.n_sequences))
    return evaluator.Predictions.from_arrays(ttc_s=ttc_s, manifest=truth.manifest)


def contents(truth: evaluator.GroundTruth, number: int) -> bytes:
    """The file of the submission `number`."""
    return evaluator.write_predictions(manifest=truth.manifest, ttc_s=predictions(truth, number).ttc_s)


def published_scores(
    truth: evaluator.GroundTruth,
    number: int,
    *,
    against: evaluator.GroundTruth | None = None,
    decimals: int = 1,
) -> dict[str, float | None]:
    """The ten numbers that a board must show, for predictions made from `truth`, scored `against` another.

    A hidden split's, unless other `decimals` are given.
    """
    values = predictions(truth, number)
    report = evaluator.evaluate(values, against or truth)
    return {name: evaluator.rounded(value, decimals=decimals) for name, value in report.flat().items()}


def join(*, split_name: str, truth: evaluator.GroundTruth, n: int, n_files: int) -> None:
    """Make the submissions 0 … n − 1 of a split, and queue them. The first `n_files` have bytes as well.

    Needs a process whose Django is configured.
    """
    from django.core.files.base import ContentFile  # noqa: PLC0415 - the settings come from the environment
    from django.db import transaction  # noqa: PLC0415
    from django.utils import timezone  # noqa: PLC0415

    from leaderboard.models import Method, Split, Submission, Team, User, Visibility  # noqa: PLC0415
    from leaderboard.people.names import skeleton  # noqa: PLC0415
    from leaderboard.queue import lifecycle  # noqa: PLC0415
    from leaderboard.storage import files  # noqa: PLC0415

    split = Split.objects.select_related("current_edition").get(pk=split_name)
    assert split.current_edition is not None
    teams = Team.objects.bulk_create(
        Team(name=f"Team {split_name} {number}", look=skeleton(f"Team {split_name} {number}"))
        for number in range(-(-n // METHODS_OF_A_TEAM))
    )
    now = timezone.now()
    shown = {"visibility": Visibility.PUBLIC, "shown_at": now}
    methods = Method.objects.bulk_create(
        Method(team=teams[number // METHODS_OF_A_TEAM], name=method_name(number), **shown)
        for number in range(n)
    )
    user, _ = User.objects.get_or_create(email="crowd@example.org")
    submissions = []
    for number, method in enumerate(methods):
        values = predictions(truth, number)
        digest, size_bytes = values.digest, 0
        if number < n_files:
            kept = files.save_predictions(ContentFile(contents(truth, number)), now=now)
            digest, size_bytes = kept.digest, kept.size_bytes
        files.save_aligned(
            evaluator.Predictions.from_arrays(ttc_s=values.ttc_s, manifest=truth.manifest, digest=digest)
        )
        submissions.append(
            Submission(
                split=split,
                method=method,
                submitted_by=user,
                submitted_at=now,
                via=Submission.Via.API,
                digest=digest,
                manifest_digest=truth.manifest.digest,
                size_bytes=size_bytes,
            )
        )
    with transaction.atomic():
        Submission.objects.bulk_create(submissions)
        lifecycle.enqueue_many(
            submission_ids=[submission.pk for submission in submissions], edition=split.current_edition
        )


def main() -> None:
    """SPLIT and N from the command line."""
    split_name, n = sys.argv[1], int(sys.argv[2])
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "leaderboard.settings")
    import django  # noqa: PLC0415 - as above

    django.setup()
    from leaderboard.models import Split  # noqa: PLC0415
    from leaderboard.storage import truth_values  # noqa: PLC0415

    edition = Split.objects.select_related("current_edition").get(pk=split_name).current_edition
    assert edition is not None
    join(split_name=split_name, truth=truth_values.load(edition.ground_truth_id), n=n, n_files=n)


if __name__ == "__main__":
    main()
