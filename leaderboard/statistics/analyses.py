"""Error analysis of an entry on an open split, for its team. Never of a hidden split."""

import itertools
from collections.abc import Collection, Mapping
from datetime import datetime
from typing import Any
from uuid import UUID

import numpy as np
from django.conf import settings
from django.contrib.auth.models import AnonymousUser
from django.db import transaction
from django.db.models import QuerySet
from numpy.typing import NDArray

import evaluator
from evaluator.metrics.protocol import Protocol
from evaluator.metrics.registry import WARNING, WARNING_S, is_warning
from evaluator.scoring import uncertainty
from evaluator.scoring.breakdown import CURVE_EDGES_S
from leaderboard.boards import snapshots
from leaderboard.boards.rows import Entry
from leaderboard.models import Analysis, Edition, Evaluation, Method, Split, Status, Submission, User
from leaderboard.sandbox import file_values
from leaderboard.storage import hidden_marks, truth_values

Floats = NDArray[np.float64]
Errors = Mapping[str, Floats]  # of every sequence, by metric

QUANTILES = (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99)
N_BINS = 24
MAX_POINTS = 500
MAX_RECORDINGS = 20
THRESHOLDS_S = (1.0, 1.5, 2.0, 2.5, WARNING_S, 3.0, 3.5, 4.0, 4.5, 5.0)


def for_submission(*, submission: Submission, viewer: User | AnonymousUser) -> Analysis | None:
    """Return the analysis of a submission for its team and maintainers, if there is one to be shown."""
    split = submission.split
    if split.is_hidden or not Submission.objects.visible_to(viewer).filter(pk=submission.pk).exists():
        return None
    return Analysis.objects.filter(
        evaluation__submission=submission, evaluation__edition=split.current_edition_id
    ).first()


def curves(*, edition: Edition, evaluations: Collection[UUID]) -> dict[UUID, list[dict[str, Any]]]:
    """The mean errors by true time to contact of evaluations of an open board, where a worker made them.

    Means over whole bins, of methods that their board shows: no value of a sequence. Never of a hidden split.
    """
    if edition.split.is_hidden or edition.pk != edition.split.current_edition_id:
        return {}
    rows = Analysis.objects.filter(evaluation__edition=edition, evaluation__in=evaluations)
    return dict(rows.values_list("evaluation_id", "content__curve"))


def reference_curves(*, split: Split, besides: Method) -> list[tuple[str, Entry, list[dict[str, Any]]]]:
    """Return public rows of an open board but for one method, each with its label and curve, if known.

    They are the best row, and the best of those that have the name of the benchmark's baseline.
    """
    board = snapshots.board(split=split, viewer=AnonymousUser())
    if board.edition is None:
        return []
    board.edition.split = board.split  # it is at hand
    ranked = [
        entry
        for entry in board.entries
        if entry.evaluation_id and entry.rank and entry.method_id != besides.pk
    ]
    ranked.sort(key=lambda entry: entry.rank or 0)
    baseline = settings.BENCHMARK.baseline
    named = [entry for entry in ranked[1:] if baseline and entry.method.startswith(baseline)]
    chosen = {"Best on the board": ranked[:1], "Baseline": named[:1]}
    ids = [entry.evaluation_id for rows in chosen.values() for entry in rows if entry.evaluation_id]
    known = curves(edition=board.edition, evaluations=ids)
    return [
        (label, entry, known[entry.evaluation_id])
        for label, rows in chosen.items()
        for entry in rows
        if entry.evaluation_id in known
    ]


# --- a worker's work -------------------------------------------------------------------------------------


def missing(*, readable_truths: Collection[str]) -> QuerySet[Evaluation]:
    """Return board entries of open splits without an analysis.

    They are in random order: those whose file cannot be read at present keep no other waiting.
    """
    opened = [digest for digest in readable_truths if not hidden_marks.is_marked(digest)]
    boards = Split.objects.filter(is_hidden=False, current_edition__ground_truth__in=opened)
    return (
        Evaluation.objects.filter(
            status=Status.SCORED,
            analysis=None,
            edition__in=boards.values("current_edition"),
            submission__withdrawn_at=None,
        )
        .select_related("edition__ground_truth", "edition__split", "submission")
        .order_by("?")
    )


def make(evaluation: Evaluation, *, now: datetime) -> None:
    """Compute and save the analysis, unless the split is hidden now or its truth was imported as hidden.

    Raises `OSError` if the store or the private directory does not answer.
    """
    if hidden_marks.is_marked(evaluation.edition.ground_truth_id):
        return
    truth = truth_values.load(evaluation.edition.ground_truth_id)
    predictions = file_values.load(evaluation.submission.sent_file, evaluation.edition)
    content = content_of(predictions, truth, rules=evaluation.edition.rules, unit=evaluation.edition.unit)
    with transaction.atomic():
        if Split.objects.lock_shared(evaluation.edition.split_id).is_hidden:
            return
        Analysis.objects.get_or_create(evaluation=evaluation, defaults={"content": content, "made_at": now})


def delete_hidden() -> None:
    """Delete the analyses of splits that have become hidden."""
    Analysis.objects.filter(evaluation__edition__split__is_hidden=True).delete()


def content_of(
    predictions: evaluator.Predictions,
    truth: evaluator.GroundTruth,
    *,
    rules: Protocol,
    unit: str | None = None,
) -> dict[str, Any]:
    """Analyse the errors of one submission; the points drawn are the same for all submissions.

    - `curve`: mean errors by true TTC, `{"low_s", "high_s", "n", "mid", …, "intervals"}` for each bin
      [low_s, high_s) with sequences; `intervals` are the 95% intervals `{"mid": [low, high], …}` of means
      with enough units;
    - `distribution`: `{"mid": […], …}`, each a list of `{"quantile", "value"}` from 0.05 to 0.99;
    - `histogram`: `{"low", "high", "n"}` of the ranking metric over 24 equal bins up to its 95% quantile;
      the last has `"high": None`;
    - `scatter`: `{"true_s": […], "predicted_s": […]}` of at most 500 random sequences, predictions truncated;
    - `worst`: at most 20 recordings by mean error in it, worst first: `{"recording", "n", "mid", …}`;
    - `warnings`, if the protocol has the warning error: for each threshold from 1 to 5 s
      `{"threshold_s", "missed", "false"}`, both `{"n", "share", "interval"}`: of the `n` sequences with a
      warning due, or without, the share in % without a warning, or with one (None of none), and its 95 %
      interval `[low, high]` where there are enough units;
    - `n_sequences` and `n_recordings`.

    Errors have the names of the protocol's metrics and are rounded as published; times to a millisecond.
    """
    report = evaluator.evaluate(predictions, truth, protocol=rules, keep_sequences=True)
    assert report.sequences is not None and report.details is not None  # noqa: S101, PT018 - asked for
    errors, decimals = report.sequences, rules.decimals
    rng = np.random.default_rng(0)
    drawn = np.sort(rng.permutation(truth.n_sequences)[:MAX_POINTS])
    predicted_s = report.details.predicted_ttc_s[drawn]
    content = {
        "n_sequences": truth.n_sequences,
        "n_recordings": truth.manifest.n_recordings,
        "curve": _curve(truth, errors, decimals, unit),
        "distribution": {
            name: [
                {"quantile": share, "value": round(float(value), decimals)}
                for share, value in zip(QUANTILES, np.quantile(values, QUANTILES), strict=True)
            ]
            for name, values in errors.items()
        },
        "histogram": _histogram(errors[rules.primary.name], decimals),
        "scatter": {
            "true_s": np.round(truth.ttc_s[drawn], 3).tolist(),
            "predicted_s": np.round(predicted_s, 3).tolist(),
        },
        "worst": _worst(truth, errors, decimals, by=rules.primary.name),
    }
    if WARNING in rules.metrics:
        content["warnings"] = _warnings(truth, report.details.predicted_ttc_s, decimals, unit)
    return content


def _curve(
    truth: evaluator.GroundTruth, errors: Errors, decimals: int, unit: str | None
) -> list[dict[str, Any]]:
    bins = np.digitize(truth.ttc_s, CURVE_EDGES_S)
    n_bins = len(CURVE_EDGES_S) + 1
    shape = (truth.manifest.n_recordings, n_bins)
    cells = truth.manifest.recording_index * n_bins + bins
    counts = np.bincount(cells, minlength=shape[0] * shape[1]).reshape(shape).astype(float)
    per_metric = [np.bincount(cells, weights=each, minlength=counts.size) for each in errors.values()]
    sums: Floats = np.stack([each.reshape(shape) for each in per_metric]).astype(float)
    low, high = _intervals(truth, counts, sums, unit)
    totals, n = sums.sum(axis=1), counts.sum(axis=0)
    return [
        {
            "low_s": low_s,
            "high_s": high_s,
            "n": int(n[i]),
            **{name: round(float(totals[k, i] / n[i]), decimals) for k, name in enumerate(errors)},
            "intervals": {
                name: [round(float(low[k, i]), decimals), round(float(high[k, i]), decimals)]
                for k, name in enumerate(errors)
                if np.isfinite(low[k, i])
            },
        }
        for i, (low_s, high_s) in enumerate(itertools.pairwise(CURVE_EDGES_S), 1)
        if n[i]
    ]


def _intervals(
    truth: evaluator.GroundTruth, counts: Floats, sums: Floats, unit: str | None
) -> tuple[Floats, Floats]:
    """Compute the intervals of means by counts (G, columns) and sums (N, G, columns) of recordings."""
    # The weights of an open split are no secret: these are those of `tsttc score`.
    units = truth.manifest.units_by(unit)
    of_units = [uncertainty.by_units(each, units) for each in (counts, sums)]
    return uncertainty.bootstrap_of(truth.digest, of_units[0]).intervals(of_units[1])


def _warnings(
    truth: evaluator.GroundTruth, predicted_ttc_s: Floats, decimals: int, unit: str | None
) -> list[dict[str, Any]]:
    index, n_recordings = truth.manifest.recording_index, truth.manifest.n_recordings
    thresholds_s = np.array(THRESHOLDS_S)[:, None]
    due, warned = (is_warning(each, threshold_s=thresholds_s) for each in (truth.ttc_s, predicted_ttc_s))

    def by_recording(*sides: NDArray[np.bool_]) -> Floats:
        rows = np.stack(sides, axis=1).reshape(-1, len(index))
        return np.stack([np.bincount(index, weights=row, minlength=n_recordings) for row in rows], axis=1)

    counts, sums = by_recording(due, ~due), 100 * by_recording(due & ~warned, ~due & warned)
    low, high = _intervals(truth, counts, sums[None], unit)
    n, totals = counts.sum(axis=0), sums.sum(axis=0)
    sides = [
        {
            "n": int(n[i]),
            "share": round(float(totals[i] / n[i]), decimals) if n[i] else None,
            "interval": [round(float(end[0, i]), decimals) for end in (low, high)]
            if np.isfinite(low[0, i])
            else None,
        }
        for i in range(len(n))
    ]
    return [
        {"threshold_s": threshold_s, "missed": missed, "false": false}
        for threshold_s, missed, false in zip(THRESHOLDS_S, sides[::2], sides[1::2], strict=True)
    ]


def _histogram(values: Floats, decimals: int) -> list[dict[str, float | int | None]]:
    end = float(np.quantile(values, 0.95)) or 1.0
    edges = np.linspace(0, end, N_BINS + 1)
    inside, _ = np.histogram(values[values < end], edges)
    rows: list[dict[str, float | int | None]] = [
        {"low": round(low, decimals), "high": round(high, decimals), "n": n}
        for low, high, n in zip(edges[:-1].tolist(), edges[1:].tolist(), inside.tolist(), strict=True)
    ]
    return [*rows, {"low": round(end, decimals), "high": None, "n": int((values >= end).sum())}]


def _worst(
    truth: evaluator.GroundTruth, errors: Errors, decimals: int, *, by: str
) -> list[dict[str, float | int | str]]:
    index, n_bags = truth.manifest.recording_index, truth.manifest.n_recordings
    counts = np.bincount(index, minlength=n_bags)
    means = {
        name: np.bincount(index, weights=values, minlength=n_bags) / counts for name, values in errors.items()
    }
    return [
        {
            "recording": truth.manifest.recordings[row],
            "n": int(counts[row]),
            **{name: round(float(values[row]), decimals) for name, values in means.items()},
        }
        for row in np.argsort(-means[by], kind="stable")[:MAX_RECORDINGS].tolist()
    ]
