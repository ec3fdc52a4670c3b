"""What the maintainers' pages say in sentences of several branches."""

from datetime import UTC, datetime
from uuid import uuid4

import pytest

from leaderboard.editions.corrections import RescoringProgress
from leaderboard.models import AuditEvent, Edition, Split
from leaderboard.web.boards import edition_tables
from leaderboard.web.maintain import edition_words
from leaderboard.web.maintain.audit_tables import AuditRow, Subject
from leaderboard.web.maintain.split_views import truth_words

DAY = datetime(2027, 3, 1, tzinfo=UTC)
CURRENT, OTHER = 1, 2


def edition(pk: int = OTHER, **fields: datetime) -> Edition:
    split = Split(name="test", title="Test", current_edition_id=CURRENT)
    return Edition(pk=pk, number=1_200 + pk, split=split, **fields)


def progress(
    *, scored: int = 0, failed: int = 0, total: int = 4, rate: float | None = None
) -> RescoringProgress:
    return RescoringProgress(
        n_total=total,
        n_scored=scored,
        n_rejected=0,
        n_failed=failed,
        n_cancelled=0,
        rate_per_s=rate,
        left_s=None if rate is None else 90.0,
    )


@pytest.mark.parametrize(
    ("row", "standing", "heading", "why_not"),
    [
        (
            edition(CURRENT, published_at=DAY),
            "current",
            "What this edition changed",
            "Edition 1201 is the current board already, so it cannot be published.",
        ),
        (edition(), "draft", "What would change", ""),
        (
            edition(discarded_at=DAY),
            "discarded",
            "What would change",
            "Edition 1202 was discarded, so it cannot be published.",
        ),
        (edition(published_at=DAY), "former", "What would change if it is published again", ""),
        (
            edition(published_at=DAY, reopened_at=DAY),
            "former, opened again",
            "What would change if it is published again",
            "",
        ),
    ],
)
def test_each_edition_is_called_what_it_is_to_its_split(
    row: Edition, standing: str, heading: str, why_not: str
) -> None:
    assert edition_words.standing(row) == standing
    assert edition_words.comparison_heading(row) == heading
    assert edition_words.why_not_published(row) == why_not


def test_discarding_a_draft_counts_what_is_cancelled_and_what_stays() -> None:
    ready = edition_words.discarding(edition(), progress(scored=4))
    assert ready.endswith("it gets a new number.")
    idle = edition_words.discarding(edition(), progress())
    assert idle == f"{ready} 4 queued evaluations are cancelled."
    almost = edition_words.discarding(edition(), progress(scored=3))
    assert almost == f"{ready} 1 queued evaluation is cancelled; 3 finished evaluations stay."
    begun = edition_words.discarding(edition(), progress(scored=1, total=2_000))
    assert begun.endswith("1,999 queued evaluations are cancelled; 1 finished evaluation stays.")


def test_closing_an_edition_again_says_what_is_still_scored() -> None:
    again = edition(published_at=DAY, reopened_at=DAY)
    assert edition_words.discarding(again, progress(scored=4)) == (
        "Edition 1202 stays a former edition, with the scores that it has. New submissions are no longer "
        "queued for it. You can open or publish it again later."
    )
    assert "for it; 1 queued evaluation is still scored. You" in edition_words.discarding(
        again, progress(scored=3)
    )
    assert "for it; 4 queued evaluations are still scored. You" in edition_words.discarding(again, progress())


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (progress(total=0), "Test has no submissions to score."),
        (progress(), "0%. 0 of 4 submissions finished."),
        (progress(scored=1), "25%. 1 of 4 submissions finished: 1 scored; 3 waiting or running."),
        (progress(scored=1, rate=0.5), "25%. 1 of 4 submissions finished: 1 scored."),
        (
            progress(scored=1_000, failed=1, total=1_001),
            "Finished. 1,001 submissions: 1,000 scored, 1 with a system error.",
        ),
    ],
)
def test_progress_is_one_sentence(state: RescoringProgress, words: str) -> None:
    assert edition_tables.running(edition(), state)["words"] == words


def test_a_split_says_whose_ground_truth_it_uses() -> None:
    val = Split(name="val", title="Validation")
    assert truth_words(val) == "hidden"
    assert truth_words(Split(name="c", title="Challenge", is_hidden=False, same_truth_as=val)) == (
        "open, that of Validation"
    )


def test_details_of_an_event_are_one_line_and_a_change_needs_no_name() -> None:
    details = [("", "A → B"), ("file", "p.json"), ("reason", "a slip; again")]
    row = AuditRow(AuditEvent(noun_id=str(uuid4())), "moved", "Method", Subject("M"), details)
    assert row.detail_words == "A → B; file: p.json; reason: a slip; again"
    assert row._replace(details=[]).detail_words == ""
