"""Processes times threads: torch in a process of a run uses one thread, in every method."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import closing

import pytest
import torch

from tests.tsttc_baselines.deep_scale.test_network import random_tensors
from tsttc_baselines.deep_scale.estimator import operations_on
from tsttc_baselines.deep_scale.weights import Use, Weights
from tsttc_baselines.processes import worked_through

pytestmark = pytest.mark.torch


def threads_of_a_method() -> Callable[[int], int]:
    """A method of a user, which imports torch and leaves its threads as they are."""
    torch.set_num_threads(2)
    return lambda _row: sys.modules["torch"].get_num_threads()


def test_each_of_several_processes_has_one_thread() -> None:
    with closing(worked_through(threads_of_a_method, range(32), n_processes=2)) as pieces:
        assert {n_threads for piece in pieces for n_threads in piece} == {1}


def test_deep_scale_has_one_thread_on_a_processor() -> None:
    torch.set_num_threads(2)
    operations_on("cpu", Weights(random_tensors(), Use()))
    assert torch.get_num_threads() == 1
