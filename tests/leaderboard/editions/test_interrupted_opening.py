"""The opening of an edition ends in the middle: nothing half-made stays, and it is run again."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from django.db import connection

from leaderboard.models import Edition, Evaluation, User
from tests import builders, editions


class Killed(Exception):
    """In the place of a signal."""


@pytest.mark.parametrize("table", ["groundtruth", "edition", "evaluation"])
def test_an_opening_that_ends_before_one_of_its_rows_leaves_no_edition_and_is_run_again(
    edition: Edition, owner: User, tmp_path: Path, table: str
) -> None:
    builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    path = editions.corrected(tmp_path, factor=1.1)

    def cut(execute: Callable[..., object], sql: str, *call: Any) -> object:
        if sql.startswith("INSERT") and f"leaderboard_{table}" in sql.partition("(")[0]:
            raise Killed
        return execute(sql, *call)

    with connection.execute_wrapper(cut), pytest.raises(Killed):
        editions.open_edition(path)
    assert (Edition.objects.count(), Evaluation.objects.count()) == (1, 1)
    for _ in range(2):
        opened = editions.open_edition(path)
        assert (opened.number, Evaluation.objects.filter(edition=opened).count()) == (2, 1)
