"""What the page asks before a file is submitted: a slot, or what becomes public, does not come back."""

import hashlib
from dataclasses import dataclass

from leaderboard.methods import visibility
from leaderboard.sandbox import first_look
from leaderboard.storage import manifests
from leaderboard.submissions import intake


@dataclass(frozen=True)
class Question:
    """Sentences that make a question of a submission; `answer` confirms these alone, for one file."""

    sentences: tuple[str, ...]
    answer: str
    digest: str


def question(request: intake.SubmissionRequest) -> Question | None:
    """Return what to ask before `intake.submit`, if anything. Raises as `intake.submit`; keeps nothing."""
    look = intake.first_look(request)
    if look.sent_before is not None:
        return None
    sentences = [*_warnings(look), *look.notes()]
    if look.method is not None and (notice := visibility.notice_of(look.method)):
        sentences.append(notice)
    if not sentences:
        return None
    about = [look.file.digest, look.split.pk, look.request.method_name, *sentences]
    answer = hashlib.sha256("\0".join(about).encode()).hexdigest()[:32]
    return Question(tuple(sentences), answer, look.file.digest)


def _warnings(look: intake.FirstLook) -> list[str]:
    edition, upload = look.split.current_edition, look.request.upload
    if edition is None or upload is None:
        return []
    manifest = manifests.load(edition.ground_truth.manifest_digest)
    warnings = first_look.warnings(upload, digest=look.file.digest, manifest=manifest)
    return [warning.message for warning in warnings]
