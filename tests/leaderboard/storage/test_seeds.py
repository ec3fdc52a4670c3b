"""The secret that random numbers of hidden splits come from: a private file, made once, told to nobody."""

import stat

import pytest
from django.core.management import call_command

from leaderboard.models import Comparison, Edition, Score, Split, Submission
from leaderboard.statistics import confidence
from leaderboard.storage import seeds
from tests import builders


def test_hidden_values_keep_their_secret_seed_whatever_the_database_calls_their_split(
    edition: Edition,
) -> None:
    seed = seeds.seed_of(edition)
    Split.objects.filter(pk="test").update(is_hidden=False)
    assert seeds.seed_of(Edition.objects.get(pk=edition.pk)) == seed


def test_a_hidden_split_has_a_seed_that_only_the_secret_gives(edition: Edition) -> None:
    seed = seeds.seed_of(edition)
    assert seed != edition.ground_truth_id
    assert seeds.seed_of(Edition.objects.get(pk=edition.pk)) == seed
    seeds.path().unlink()
    assert seeds.seed_of(edition) != seed


def test_the_secret_is_the_owners_alone_and_made_by_an_import(edition: Edition) -> None:
    assert stat.S_IMODE(seeds.path().stat().st_mode) == 0o600
    assert len(bytes.fromhex(seeds.path().read_text())) == seeds.N_BYTES
    assert not [path for path in seeds.path().parent.iterdir() if path.name.startswith("tmp")]


def test_a_secret_that_is_there_is_never_replaced(edition: Edition) -> None:
    before = seeds.path().read_text()
    call_command("make_seed_key")
    assert seeds.path().read_text() == before


def test_a_damaged_secret_is_an_error_and_no_seed_is_made_of_it(edition: Edition) -> None:
    seeds.path().write_text("abc\n")
    with pytest.raises(seeds.NoSecret, match="expected 32; put it back from the backup"):
        seeds.seed_of(edition)


def test_where_it_can_be_neither_read_nor_made_the_error_says_how(edition: Edition) -> None:
    seeds.path().unlink()
    seeds.path().mkdir()
    with pytest.raises(seeds.NoSecret, match=r"manage\.py make_seed_key"):
        seeds.seed_of(edition)


def test_the_secret_is_in_no_row_and_in_no_log(
    entries: list[Submission], edition: Edition, capfd: pytest.CaptureFixture[str]
) -> None:
    builders.infer_all()
    text = repr(list(Edition.objects.values())) + repr(list(Score.objects.values()))
    text += repr(list(Comparison.objects.values())) + "".join(capfd.readouterr())
    for secret in (seeds.path().read_text().strip(), confidence.seed_of(edition)):
        assert secret not in text
