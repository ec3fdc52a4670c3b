"""An edition keeps its unit: days for new ones that have them, recordings for those from before."""

from datetime import date, timedelta
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from django.core.management import CommandError, call_command
from django.test import Client
from django.utils import timezone

from evaluator import (
    GroundTruth,
    Predictions,
    compare_predictions,
    confidence_intervals,
    read_predictions,
    rounded,
)
from leaderboard.editions import ground_truth
from leaderboard.models import Edition, Split, Submission, User
from leaderboard.statistics import comparisons
from leaderboard.storage import files, truth_values
from tests import builders, pages
from tests.editions import ANYBODY, open_edition, publish
from tests.leaderboard.statistics.inferred_scores import everything, scores_of

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("open_values")]


def dated(tmp_path: Path, *, n_days: int = 32, per_day: int = 3, unit: bool = False, seed: int = 0) -> Path:
    """The made-up truth, whose recordings are named by their dates; with `unit` each belongs to a trip."""
    n_recordings = n_days * per_day
    lines = builders.truth_csv(
        tmp_path / "plain.csv", n=480, n_recordings=n_recordings, seed=seed
    ).read_text()
    rows = [line.split(",") for line in lines.splitlines()]
    for fields in rows[1:]:
        recording = int(fields[1])
        day = date(2023, 3, 14) + timedelta(days=recording // per_day)
        fields[1] = f"{day}-13-00-{recording % per_day:02d}-797143"
        fields.extend([f"trip{recording % 12}"] if unit else [])
    rows[0] += ["unit"] if unit else []
    path = tmp_path / f"dated-{n_days}-{unit}-{seed}.csv"
    path.write_text("".join(f"{','.join(fields)}\n" for fields in rows))
    return path


def imported(path: Path) -> Edition:
    Split.objects.update(quota_limit=None, quota_min_gap=timedelta(0), quota_rejected_limit=None)
    return ground_truth.import_truth(split_name="test", path=path, now=timezone.now())


def filled(edition: Edition, owner: User) -> list[Submission]:
    """Three methods with scores, intervals and ranges."""
    sent = []
    for number, factor in enumerate((1.1, 1.12, 1.4)):
        data = builders.predictions(edition, factor=factor)
        sent.append(builders.submit(owner, data, method=f"M{number}"))
    builders.score_all()
    builders.infer_all()
    edition.refresh_from_db()
    return sent


def compared(*sent: Submission, edition: Edition | None = None) -> comparisons.Compared:
    def ask() -> comparisons.Compared:
        return comparisons.compare(
            methods=[each.method_id for each in sent],
            split=Split.objects.select_related("current_edition__ground_truth").get(pk="test"),
            edition=edition,
            viewer=ANYBODY,
            now=timezone.now(),
        )

    ask()
    builders.infer_all()
    return ask()


def read(sent: Submission, truth: GroundTruth) -> Predictions:
    with files.opened_predictions(sent.digest) as kept:
        return read_predictions(kept.read(), manifest=truth.manifest)


def holds_offline(edition: Edition, sent: list[Submission], *, unit: str) -> None:
    """The board's intervals and comparisons are those of the library with this unit."""
    truth = truth_values.load(edition.ground_truth_id)
    for each in sent:
        offline = confidence_intervals(read(each, truth), truth, protocol=edition.rules, unit=unit)
        for name, score in scores_of(each, edition).items():
            expected = [rounded(end, decimals=1) for end in offline[name] or (None, None)]
            assert [score.low, score.high] == expected, name
    pair = compared(*sent[:2], edition=edition).pairs[0].differences
    first, second = (read(each, truth) for each in sent[:2])
    assert pair == compare_predictions(first, second, truth, protocol=edition.rules, decimals=1, unit=unit)


def test_intervals_ranges_and_tests_of_an_edition_of_days_are_over_days(tmp_path: Path, owner: User) -> None:
    edition = imported(dated(tmp_path))
    sent = filled(edition, owner)
    assert edition.n_effective["mid"] == 32.0
    holds_offline(edition, sent, unit="day")
    assert scores_of(sent[0], edition)["mid"].rank_low == 1


@pytest.fixture
def old(tmp_path: Path, owner: User) -> Edition:
    """An edition of dated recordings from before there were units, with its published numbers."""
    edition = imported(dated(tmp_path))
    Edition.objects.filter(pk=edition.pk).update(unit="recording", n_units=None)
    edition.refresh_from_db()
    filled(edition, owner)
    return edition


def test_an_edition_from_before_keeps_recordings_and_every_number(
    old: Edition, tmp_path: Path, owner: User
) -> None:
    sent = list(Submission.objects.order_by("submitted_at"))
    assert old.n_effective["mid"] == 96.0
    holds_offline(old, sent, unit="recording")
    before = everything()
    new = open_edition()
    builders.score_all()
    builders.infer_all()
    publish(new)
    builders.infer_all()
    new.refresh_from_db()
    assert (new.number, new.units, new.n_effective["mid"]) == (2, "32 days", 32.0)
    assert new.ground_truth_id == old.ground_truth_id
    holds_offline(new, sent, unit="day")
    assert everything()[: len(before)] == before, "what was published stays"
    old.refresh_from_db()
    assert (old.units, old.n_effective["mid"]) == ("96 recordings", 96.0)


def test_the_ground_truths_own_units_are_public_and_taken(
    client: Client, tmp_path: Path, owner: User
) -> None:
    edition = imported(dated(tmp_path, unit=True))
    assert (edition.unit, edition.units) == ("given", "12 units")
    text = b"".join(client.get("/api/v1/splits/test/manifest")).decode()
    assert text.splitlines()[0] == "anno_id,bag_stamp,cam_id,ts,track_id,unit"
    holds_offline(edition, filled(edition, owner), unit="given")


# --- who says it --------------------------------------------------------------------------------------------


def test_pages_answers_and_exports_say_which_unit_it_is(client: Client, tmp_path: Path, owner: User) -> None:
    edition = imported(dated(tmp_path))
    sent = filled(edition, owner)
    compared(*sent[:2])

    def words(address: str, **query: Any) -> str:
        response = client.get(address, query)
        assert response.status_code == 200, address
        return pages.page(response).one("main").text

    assert "95% confidence interval (bootstrap over 32 days)" in words("/board/test/")
    assert "32 days: treated as independent in confidence intervals" in words("/board/test/editions/1/")
    method = words(f"/methods/{sent[0].method_id}/").replace("\xa0", " ")
    assert "95% confidence intervals and rank ranges, computed from 32 days." in method
    pair = [str(each.method_id) for each in sent[:2]]
    sentence = "sign-flip test of whole days (32 days), because recordings from one day resemble each other."
    assert sentence in words("/compare/", split="test", m=pair)
    for address, query in (
        ("/api/v1/splits/test/board", {}),
        ("/api/v1/compare", {"split": "test", "m": pair}),
    ):
        document = client.get(address, query).json()
        assert (document["unit"], document["n_units"]) == ("day", 32), address
    (listed,) = client.get("/api/v1/splits/test/editions").json()
    assert (listed["unit"], listed["n_units"]) == ("day", 32)
    caption = "95% confidence interval, bootstrap over 32 days"
    for form in ("tex", "md"):
        text = client.get(f"/board/test.{form}", {"intervals": "1"}, follow=True).text
        assert caption in text.replace("\\%", "%"), form


# --- are the recordings of one day alike? -------------------------------------------------------------------


def checked(number: int = 1) -> list[str]:
    out = StringIO()
    call_command("check_units", "test", str(number), stdout=out)
    return out.getvalue().splitlines()


def test_the_check_has_a_line_for_each_method_and_for_its_difference_from_the_best(
    tmp_path: Path, owner: User
) -> None:
    filled(imported(dated(tmp_path)), owner)
    first, head, *rows = checked()
    assert first == "test edition 1: 96 recordings in 32 days; its unit is the day."
    assert head == "SE factor  correlation       p  overall MiD of"
    assert [row.split(maxsplit=3)[3] for row in rows] == ["M0", "M1", "M1 − M0", "M2", "M2 − M0"]
    for row in rows:
        factor, correlation, p = map(float, row.split()[:3])
        assert (0.5 < factor < 1.6, abs(correlation) < 0.5, 0 < p <= 1) == (True, True, True)


def test_the_check_of_names_without_dates_says_why_not(edition: Edition) -> None:
    with pytest.raises(CommandError, match=r"test edition 1 has nothing to check\. Not every recording's"):
        checked()
