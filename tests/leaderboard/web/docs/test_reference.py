"""The facts at `/docs/`, which come from the protocols of the boards."""

from pathlib import Path

import pytest
from django.test import Client

from tests import builders
from tests.pages import get

pytestmark = pytest.mark.slow


def test_a_metric_that_only_another_board_has_is_explained_with_its_board(
    client: Client, tmp_path: Path, benchmark: None
) -> None:
    builders.import_truth(tmp_path)
    builders.import_truth(tmp_path, split="val", seed=1, protocol="tsttc-2")
    text = get(client, "/docs/").one("main").text
    assert "Protocol tsttc-1" in text
    assert "Warning error (WE), in %, only on Validation (protocol tsttc-2)" in text
    assert "its MiD and RTE are those of the dataset’s toolkit" in text
