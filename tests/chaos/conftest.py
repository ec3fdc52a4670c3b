"""A running site with services of its own, for tests that take them away."""

from collections.abc import Iterator

import numpy as np
import pytest

import evaluator
from leaderboard.demo.runs import simulate
from tests.chaos.services import postgres_folder, redis_program
from tests.chaos.site import Site, running_site
from tests.services import ServiceMissing, skip_or_fail


@pytest.fixture(scope="session")
def installed() -> None:
    """PostgreSQL's and Redis's programs: these tests start servers of their own."""
    try:
        postgres_folder()
        redis_program()
    except ServiceMissing as missing:
        skip_or_fail(missing)


@pytest.fixture(scope="module")
def truth() -> evaluator.GroundTruth:
    return simulate(rng=np.random.default_rng(3), n_sequences=300, n_recordings=20)


@pytest.fixture(scope="module")
def site(
    installed: None, tmp_path_factory: pytest.TempPathFactory, truth: evaluator.GroundTruth
) -> Iterator[Site]:
    """Web and one worker, with a PostgreSQL and a Redis of their own."""
    with running_site(tmp_path_factory.mktemp("site"), truth=truth, n_workers=1) as running:
        yield running
