"""A refused upload leaves no file, and removes no file of another submission: equal bytes are one file."""

import os
import random
from collections.abc import Callable, Iterator
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from django.core.files.base import ContentFile
from django.db import connection

from leaderboard.errors.refusals import Refused
from leaderboard.models import Edition, Split, Submission, User
from leaderboard.people import teams
from leaderboard.quotas import usage
from leaderboard.storage import files
from tests import builders
from tests.interlocking import meet
from tests.leaderboard.db.test_races import at_once
from tests.services import ON_POSTGRESQL, crowd_on_postgres

DATA = b'{"0": 1.5}'


class Meanwhile(ContentFile):  # type: ignore[type-arg]  # of bytes
    """An upload during which something else happens: once it is admitted, and before anything is locked."""

    def __init__(self, data: bytes, action: Callable[[], object]) -> None:
        super().__init__(data, name="p.json")
        # It is read twice: to be hashed, and to be stored.
        self._actions = [action, lambda: None]

    def chunks(self, chunk_size: int | None = None) -> Iterator[Any]:
        """The bytes, after the action."""
        if self._actions:
            self._actions.pop()()
        return super().chunks(chunk_size)


def file_of(data: bytes) -> ContentFile:  # type: ignore[type-arg]  # of bytes
    return ContentFile(data, name="p.json")


def age(data: bytes) -> None:
    """Make the file, if it is stored, so old that the next upload writes it again."""
    path = Path(files.store().path(files.predictions_name(files.measure(file_of(data)).digest)))
    if path.exists():
        os.utime(path, (0, 0))


def stored(tmp_path: Path) -> list[str]:
    """The digests of the prediction files there are."""
    return sorted(f"sha256:{path.stem}" for path in (tmp_path / "files" / "predictions").rglob("*.json"))


def one_slot() -> None:
    Split.objects.filter(pk="test").update(quota_limit=1, quota_window=timedelta(days=1))


def test_a_file_whose_slot_was_taken_meanwhile_is_not_kept(
    edition: Edition, owner: User, tmp_path: Path
) -> None:
    one_slot()
    upload = Meanwhile(DATA, lambda: builders.send(owner, file_of(b"first")))
    with pytest.raises(usage.QuotaExceeded):
        builders.send(owner, upload)
    [first] = Submission.objects.all()
    assert stored(tmp_path) == [first.digest]


def test_a_refused_file_that_a_submission_names_stays(
    edition: Edition, owner: User, stranger: User, tmp_path: Path
) -> None:
    one_slot()
    theirs = builders.send(stranger, file_of(DATA)).submission
    age(DATA)
    upload = Meanwhile(DATA, lambda: builders.send(owner, file_of(b"first")))
    with pytest.raises(usage.QuotaExceeded):
        builders.send(owner, upload)
    assert theirs.digest in stored(tmp_path)


def test_a_file_that_is_removed_before_its_row_is_written_is_kept_again(
    edition: Edition, owner: User, tmp_path: Path
) -> None:
    """Another user, refused with the same bytes, removes it."""
    teams.team_of(user=owner)

    def remove(execute: Callable[..., Any], sql: str, *rest: Any) -> Any:
        if not removed and "SAVEPOINT" in sql:
            removed.append(DATA)
            files.store().delete(files.predictions_name(files.measure(file_of(DATA)).digest))
        return execute(sql, *rest)

    removed: list[bytes] = []
    with connection.execute_wrapper(remove):
        sent = builders.send(owner, file_of(DATA)).submission
    assert removed
    assert stored(tmp_path) == [sent.digest]


def test_a_store_that_does_not_answer_does_not_hide_the_refusal(
    edition: Edition, owner: User, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one_slot()
    upload = Meanwhile(DATA, lambda: builders.send(owner, file_of(b"first")))

    def fail(self: object, name: str) -> None:
        raise files.StoreUnavailable("away")

    monkeypatch.setattr(files.DurableFileSystemStorage, "delete", fail)
    with pytest.raises(usage.QuotaExceeded):
        builders.send(owner, upload)
    assert len(stored(tmp_path)) == 2, "the cleaning finds it in a day"


# --- at the same moment ----------------------------------------------------------------------------------


class TestAtOnce:
    """On PostgreSQL, where several write at once."""

    pytestmark = ON_POSTGRESQL

    def test_of_a_burst_the_one_that_was_taken_leaves_a_file(
        self, edition: Edition, owner: User, tmp_path: Path
    ) -> None:
        one_slot()
        teams.team_of(user=owner)

        def sent(number: int) -> bool:
            try:
                return builders.send(owner, file_of(random.Random(number).randbytes(1000))).is_new
            except usage.QuotaExceeded:
                return False

        assert sum(at_once(12, sent)) == 1
        assert stored(tmp_path) == [Submission.objects.get().digest]

    @pytest.mark.parametrize("paused", ["refused", "accepted"])
    def test_no_moment_loses_the_bytes_that_another_team_has_acknowledged(
        self, edition: Edition, owner: User, stranger: User, tmp_path: Path, paused: str
    ) -> None:
        """One of the two is held after each of its statements in turn, while the other does all it can."""
        for user in (owner, stranger):
            teams.team_of(user=user)
        # Of the same name as the other's method, so only the owner's is refused, and under the lock.
        builders.submit(owner, b"first", method="Foo")
        with crowd_on_postgres():
            number, was_paused = 0, True
            while was_paused:
                number += 1
                data = b"%d" % number
                actions: dict[str, Callable[[], object]] = {
                    "refused": partial(refused, owner, data),
                    "accepted": partial(builders.send, stranger, file_of(data)),
                }
                first, second = actions.pop(paused), *actions.values()

                def is_here(n_statements: int, sql: str, number: int = number) -> bool:
                    return n_statements == number

                outcome = meet(first, second, at=is_here)
                was_paused = outcome.was_paused
                assert outcome.faults == (None, None)
                [kept] = Submission.objects.filter(digest=files.measure(file_of(data)).digest)
                assert kept.digest in stored(tmp_path), f"held at statement {number}"
        assert number > 5


def test_a_method_that_another_request_makes_meanwhile_is_the_same_method(
    edition: Edition, owner: User
) -> None:
    teams.team_of(user=owner)
    first = [lambda: builders.send(owner, file_of(b"first"), method="Foo")]

    def makes_it(execute: Callable[..., Any], sql: str, *rest: Any) -> Any:
        cursor = execute(sql, *rest)
        if first and '"leaderboard_method"."name" = ' in sql:
            first.pop()()
        return cursor

    with connection.execute_wrapper(makes_it):
        second = builders.send(owner, file_of(b"second"), method="Foo")
    assert not first
    assert set(Submission.objects.values_list("method", flat=True)) == {second.submission.method_id}
    assert Submission.objects.count() == 2


def refused(user: User, data: bytes) -> None:
    """Send a file that is refused once it is stored, since its method's name looks like another one."""
    age(data)
    name = f"Bar {data.decode()}"
    meanwhile = Meanwhile(data, lambda: builders.send(user, file_of(b"other" + data), method=name))
    with pytest.raises(Refused, match="looks like"):
        builders.send(user, meanwhile, method=name.replace("a", "а"))
