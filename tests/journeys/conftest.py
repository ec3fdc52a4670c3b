"""A site for the journeys, and the people on it."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

import evaluator
from leaderboard.demo.runs import simulate
from tests.journeys.broker import Broker, broker_of_compose
from tests.journeys.people import Program, Visitor
from tests.journeys.production import Site, production_site
from tests.prepared import postgres_url

__all__ = ["postgres_url"]


@pytest.fixture(scope="module")
def truth() -> evaluator.GroundTruth:
    """Ground truth made up for the journeys: 1,200 sequences in 40 recordings."""
    table = simulate(rng=np.random.default_rng(7), n_sequences=1_200, n_recordings=40).to_table()
    # With digits that nothing else has, so that a value is recognised wherever it turns up.
    table.ttc_s = [value * 1.000000123 for value in table.ttc_s]
    return evaluator.GroundTruth.from_table(table)


@pytest.fixture(scope="module")
def broker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Broker]:
    """A Redis of this module's own, under the rules of production."""
    with broker_of_compose(tmp_path_factory.mktemp("redis")) as running:
        yield running


@pytest.fixture(scope="module")
def site(
    tmp_path_factory: pytest.TempPathFactory,
    postgres_url: str,
    broker: Broker,
    truth: evaluator.GroundTruth,
) -> Iterator[Site]:
    """A production site whose split `test` is open."""
    directory: Path = tmp_path_factory.mktemp("site")
    table = directory / "truth.csv"
    table.write_bytes(truth.to_csv())
    with production_site(
        directory, postgres_url=postgres_url, redis_url=broker.url, truth=table, split="test"
    ) as running:
        yield running


@pytest.fixture
def people() -> Iterator[Callable[[Site], Visitor]]:
    """Makes visitors, and sends them home at the end."""
    with ExitStack() as visitors:

        def arrive(site: Site) -> Visitor:
            visitor = Visitor(site)
            visitors.callback(visitor.close)
            return visitor

        yield arrive


@pytest.fixture
def programs() -> Iterator[Callable[[Site, str], Program]]:
    """Makes programs with a token of the person of that address, and ends them."""
    with ExitStack() as started:

        def start(site: Site, email: str) -> Program:
            program = Program(site, email=email)
            started.callback(program.close)
            return program

        yield start
