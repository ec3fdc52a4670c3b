"""Training: its labels and rates, that it learns, and that an ended one continues."""

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from evaluator import GroundTruth, read_truth
from tests.tsttc_baselines.made_folders import made_folder, stamp
from tsttc_baselines.clips import Clip
from tsttc_baselines.deep_scale.samples import Sample, batches
from tsttc_baselines.deep_scale.weights import Decoding, Use, Weights, read_weights
from tsttc_baselines.folders import read_folder
from tsttc_baselines.methods import OWN_WEIGHTS
from tsttc_baselines.pairs import FolderSequences, RenderedSequences, usable_pair
from tsttc_baselines.simulation import split

pytestmark = [pytest.mark.slow, pytest.mark.torch]

SMALL = Use(similarity="cosine", n_cells=10, max_box_px=16.0, margin_px=4.0)


@pytest.fixture(scope="module")
def training() -> Any:
    """The module that trains, which needs torch."""
    import torch  # noqa: PLC0415 -- where there is none, `tests/conftest.py` leaves this out

    torch.set_num_threads(1)
    from tsttc_baselines.deep_scale import training  # noqa: PLC0415 -- it imports torch

    return training


@pytest.fixture(scope="module")
def source() -> RenderedSequences:
    """Sixteen rendered sequences."""
    return RenderedSequences(split(rng=np.random.default_rng(2), n_sequences=16, n_recordings=2), seed=2)


@pytest.fixture(scope="module")
def samples(source: RenderedSequences) -> list[Sample]:
    """All samples of an epoch."""
    epoch = list(batches(source, use=SMALL, size=4, rng=np.random.default_rng(0)))
    assert sum(n_rows for n_rows, _ in epoch) == 16
    return [sample for _, batch in epoch for sample in batch]


def test_labels_lie_between_the_two_nearest_scale_ratios(training: Any) -> None:
    scales = np.linspace(0.65, 1.5, 20)
    labels = training.labels([0.65, 0.9, 1.49])
    np.testing.assert_allclose(labels @ scales, [0.65, 0.9, 1.49])
    assert np.count_nonzero(labels, axis=1).tolist() == [1, 2, 2]


def test_the_rate_warms_up_falls_and_stays_low(training: Any) -> None:
    recipe = training.Recipe()
    rates = [recipe.learning_rate(epoch / 36) for epoch in (0, 0.5, 1, 16.5, 32, 35)]
    np.testing.assert_allclose(rates, np.array([0, 0.25, 1, 0.505, 0.01, 0.01]) * 1.6e-3, rtol=1e-9)


def test_thirty_steps_halve_the_loss(training: Any, samples: list[Sample]) -> None:
    recipe = training.Recipe(batch=3, optimizer="adam", use=SMALL)
    network = training.Network(training.new_tensors(seed=0), recipe=recipe, device="cpu")
    losses = [network.learn(samples[:3], learning_rate=5e-3) for _ in range(30)]
    assert losses[-1] <= 0.5 * losses[0]


class Ended(Exception):
    """Ends a training, as Ctrl-C does."""


def end(epochs: tuple[object, ...]) -> None:
    if epochs:
        raise Ended


def test_an_ended_training_goes_on_as_if_nothing_had_been(
    training: Any, source: RenderedSequences, tmp_path: Path
) -> None:
    rows = slice(0, 4)
    few = SimpleNamespace(
        truth=SimpleNamespace(n_sequences=4, digest="few"),
        scale_ratios=source.scale_ratios[rows],
        clip=source.clip,
    )
    recipe = training.Recipe(epochs=2, batch=4, optimizer="adam", lr_per_pair=1e-3, use=SMALL)
    validation = SimpleNamespace(scores=lambda *_, **__: {"overall": {"mid": 1.0, "rte": 1.0}})
    known = {"source": few, "validation": validation, "recipe": recipe}
    whole = training.train(**known, out=tmp_path / "whole.npz")
    with pytest.raises(Ended):
        training.train(**known, out=tmp_path / "ended.npz", after_epoch=end)
    reported: list[int] = []
    ended = training.train(**known, out=tmp_path / "ended.npz", progress=reported.append)
    assert reported == [4, 8]
    assert [replace(epoch, loss=0) for epoch in ended] == [replace(epoch, loss=0) for epoch in whole]
    one, other = (read_weights(tmp_path / f"{name}.npz") for name in ("whole", "ended"))
    for name, values in one.tensors.items():
        np.testing.assert_allclose(values, other.tensors[name], atol=1e-5)
    assert one.card["recipe"]["optimizer"] == "adam"
    assert {path.name for path in tmp_path.iterdir()} == {"whole.npz", "ended.npz"}


@dataclass(frozen=True)
class Rows:
    """The first sequences of a source, for learning and for scores."""

    whole: RenderedSequences
    n_rows: int = 4

    @property
    def truth(self) -> GroundTruth:
        return read_truth(b"\n".join(self.whole.truth.to_csv().splitlines()[: 1 + self.n_rows]))

    @property
    def scale_ratios(self) -> NDArray[np.float64]:
        return self.whole.scale_ratios[: self.n_rows]

    def clip(self, row: int) -> Clip:
        return self.whole.clip(row)


@pytest.mark.parametrize("decoding", ["head", "fit"])
def test_with_a_start_the_score_before_epoch_1_comes_first_and_no_rate_keeps_it(
    training: Any,
    source: RenderedSequences,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    decoding: Decoding,
) -> None:
    # Batches move the running means whatever the rate is.
    monkeypatch.setattr("tsttc_baselines.deep_scale.torch_layers.BN_MOMENTUM", 0.0)
    start = Weights(read_weights(OWN_WEIGHTS).tensors, replace(SMALL, decoding=decoding))
    recipe = training.Recipe(epochs=1, batch=2, lr_per_pair=1e-12, use=start.use)
    rows = Rows(source)
    known = {"source": rows, "validation": training.Validation(rows), "recipe": recipe, "start": start}
    reported: list[Any] = []
    epochs = training.train(**known, out=tmp_path / "w.npz", after_epoch=reported.append)
    assert reported == [tuple(epochs[:1]), tuple(epochs)]
    assert [epoch.number for epoch in epochs] == [0, 1]
    before, after = epochs
    assert (before.loss, before.n_left_out, before.learning_rate) == (None, 0, None)
    assert 0 < after.learning_rate <= 2e-12
    scored = training.Validation(rows).scores(
        training.Network(as_torch(training, start), recipe=recipe, device="cpu").operations(), use=start.use
    )
    assert before.mid == pytest.approx(scored["overall"]["mid"])
    assert after.mid == pytest.approx(before.mid, rel=1e-4)
    card = read_weights(tmp_path / "w.npz").card
    assert [epoch["number"] for epoch in card["epochs"]] == [0, 1]


def as_torch(training: Any, weights: Weights) -> dict[str, Any]:
    return {name: training.torch.from_numpy(each.copy()) for name, each in weights.tensors.items()}


TRUTH = "anno_id,bag_stamp,cam_id,ts,track_id,ttc\n"


def test_a_folder_is_learned_from_in_the_order_of_its_truth(tmp_path: Path) -> None:
    folder = made_folder(tmp_path)
    rows = [f"{anno_id},0007,1,{stamp(anno_id, 5)},{anno_id},{2.0 + anno_id}" for anno_id in (2, 0)]
    (folder / "truth.csv").write_text(TRUTH + "\n".join(rows) + "\n")
    truth = read_truth(folder / "truth.csv")
    source = FolderSequences.of(read_folder(folder), truth)
    clips: list[Clip] = [source.clip(row) for row in range(2)]
    assert [clip.anno_id for clip in clips] == truth.manifest.anno_id.tolist()
    assert usable_pair(source, 0, scale_ratio=0.8).reference.ndim == 3
