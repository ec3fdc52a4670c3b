"""Score receipts: the scores of a submission in one edition, signed with the site's key."""

from collections.abc import Sequence
from typing import Any, Final

from django.conf import settings
from django.core.checks import CheckMessage, Error, Info
from django.core.exceptions import ImproperlyConfigured

from evaluator import receipts
from leaderboard.boards.rows import flat_scores
from leaderboard.errors.refusals import Refused
from leaderboard.models import Evaluation, Status, Submission
from leaderboard.submissions.progress import evaluation_of

PUBLIC_KEY: Final = "TSTTC_RECEIPT_PUBLIC_KEY"
MEDIA_TYPE: Final = "application/jwt"


def receipt(*, submission: Submission, edition_number: int | None = None) -> str:
    """Sign the receipt of a submission, in that edition or the present one. Raises `Refused`."""
    evaluation = _scored(submission, edition_number)
    edition, rules = evaluation.edition, evaluation.edition.rules
    scores = flat_scores(evaluation)
    counts = (evaluation.report or {})["counts"]
    assert evaluation.finished_at is not None  # noqa: S101 - for the type checker: what is scored is finished
    document = {
        "site": settings.SITE_URL,
        "submission": str(submission.pk),
        "split": submission.split_id,
        "edition": edition.number,
        "protocol": edition.protocol,
        "ground_truth": edition.ground_truth_id,
        "file": submission.digest,
        "method": {"id": str(submission.method_id), "name": submission.method.name},
        "scores": {
            name: receipts.decimal(scores[name], decimals=edition.decimals) for name in rules.score_names
        },
        "counts": {name: counts[name] for name in rules.range_names},
        "scored_at": f"{evaluation.finished_at:%Y-%m-%dT%H:%M:%SZ}",
    }
    return receipts.sign(document, private_key=private_key())


def _scored(submission: Submission, edition_number: int | None) -> Evaluation:
    if submission.withdrawn_at:
        raise Refused("withdrawn", "The submission is withdrawn; expected one that is not.")
    if edition_number is None:
        evaluation = evaluation_of(submission)
    else:
        # An edition in preparation may still be given up: nothing of it is anybody's to quote.
        published = submission.evaluations.exclude(edition__published_at=None)
        row = published.filter(edition__number=edition_number).first()
        if row is None:
            raise Refused(
                "edition-unknown",
                f"The submission has no score in an edition {edition_number} of {submission.split_id}; "
                "expected the number of an edition that was published.",
            )
        evaluation = row
    if evaluation.status != Status.SCORED or evaluation.edition.published_at is None:
        state = evaluation.get_status_display()
        raise Refused("not-scored", f"The submission is {state}; expected one that is scored.")
    return evaluation


def private_key() -> bytes:
    """Return the seed that receipts are signed with."""
    return _key("TSTTC_RECEIPT_KEY", settings.RECEIPT_KEY)


def public_keys() -> dict[str, Any]:
    """Return the published key set: the present key first, then former ones."""
    former = [_key("TSTTC_RECEIPT_OLD_KEYS", text) for text in settings.RECEIPT_OLD_KEYS]
    return receipts.key_set([receipts.public_key(private_key()), *former])


def known_public_keys() -> dict[str, Any]:
    """Return the key set as far as this process knows it: one without the key may have its public half."""
    if settings.HAS_RECEIPT_KEY:
        return public_keys()
    given = [_key(PUBLIC_KEY, settings.RECEIPT_PUBLIC_KEY)] if settings.RECEIPT_PUBLIC_KEY else []
    former = [_key("TSTTC_RECEIPT_OLD_KEYS", text) for text in settings.RECEIPT_OLD_KEYS]
    return receipts.key_set([*given, *former])


def _key(name: str, text: str) -> bytes:
    try:
        key = receipts.decode(text.strip())
    except ValueError:
        key = b""
    if len(key) != receipts.KEY_BYTES:
        raise ImproperlyConfigured(
            f"{name} is malformed; expected 43 characters of base64url, as `manage.py make_receipt_key` "
            "prints them."
        )
    return key


def check_keys(app_configs: Sequence[Any] | None = None, **kwargs: Any) -> list[CheckMessage]:
    try:
        public_keys()
        known_public_keys()
    except ImproperlyConfigured as fault:
        return [Error(str(fault), id="leaderboard.E001")]
    if not settings.HAS_RECEIPT_KEY:
        return []
    given, own = settings.RECEIPT_PUBLIC_KEY, receipts.encode(receipts.public_key(private_key()))
    if given and given != own:
        message = f"{PUBLIC_KEY} is {given!r}; expected {own!r}, the public half of TSTTC_RECEIPT_KEY."
        return [Error(message, id="leaderboard.E001")]
    return []


def check_public_key(app_configs: Sequence[Any] | None = None, **kwargs: Any) -> list[CheckMessage]:
    """Say in production what backups lack. No fault: the site does without."""
    if settings.PRODUCTION and settings.HAS_RECEIPT_KEY and not settings.RECEIPT_PUBLIC_KEY:
        own = receipts.encode(receipts.public_key(private_key()))
        return [Info(f"{PUBLIC_KEY} is not set; for backups, set it to {own}", id="leaderboard.I002")]
    return []
