"""Training of the network in torch: the paper's recipe (§5.2, §6.1) and its variations.

    trained = train(source=…, validation=…, recipe=Recipe(), out=Path("weights.npz"))

The label of a scale ratio α_i is max(0, 1 − |α_i − α| / Δ), Δ their distance (toolkit, `gt_to_one_hot`); the
loss is the binary cross-entropy, summed over scale ratios. The evaluator scores each epoch.
"""

from __future__ import annotations

import hashlib
import json
import math
import pickle
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812 -- torch's own name for it
from numpy.typing import NDArray

from evaluator import Predictions, evaluate, fps_of_gap, scale_ratio_to_ttc
from evaluator.problems import reject
from tsttc_baselines.deep_scale.estimator import N_TOP, cut, network_logits, network_scales
from tsttc_baselines.deep_scale.fit import equations, evened, fitted_scale_ratio, solution, weighting
from tsttc_baselines.deep_scale.fit_samples import FitSample
from tsttc_baselines.deep_scale.network import features
from tsttc_baselines.deep_scale.samples import Sample, batches
from tsttc_baselines.deep_scale.torch_layers import TorchLayers
from tsttc_baselines.deep_scale.weights import SHAPES, Use, Weights, write_weights
from tsttc_baselines.detection import scale_ratio_of_two
from tsttc_baselines.estimates import Unusable
from tsttc_baselines.pairs import Source, usable_pair

Floats = NDArray[np.float64]
Optimizer = Literal["sgd", "adam"]
Progress = Callable[[int], None]

MAX_GRADIENT: Final = 40.0
"""A longer gradient is shortened to this: a few pairs must not undo what was learned."""

_LAST_SHARE: Final = 0.01
"""The learning rate at the end, as a share of the greatest."""

_MOMENTUM: Final = 0.9

_MID_OF_FIT: Final = 2000.0
"""|ln α̂ − ln α| over five frames, times this, is MiD (10⁴ for one frame)."""

_OUTLIER_MID: Final = 30.0
"""Errors beyond this count by their logarithm: those of a vehicle that is hidden, or of a label."""


class DeviceMissing(Exception):
    """torch cannot use a graphics card here."""


@dataclass(frozen=True, slots=True)
class Recipe:
    """The training's settings; defaults are the paper's, else the toolkit's.

    A batch's learning rate is `lr_per_pair` times its size: warm-up in the first of 36 epochs, cosine, low
    for the last four (or these parts of fewer). `ratio_weight` multiplies |ln α̂ − ln α| in the loss,
    `fit_weight` the error of a step of the fit in MiD; the paper has neither.
    """

    epochs: int = 36
    batch: int = 16
    lr_per_pair: float = 1e-4
    optimizer: Optimizer = "sgd"
    weight_decay: float = 5e-4
    ratio_weight: float = 0.0
    fit_weight: float = 0.0
    seed: int = 0
    use: Use = field(default_factory=lambda: Use(similarity="cosine"))

    def learning_rate(self, progress: float) -> float:
        """Return the rate at `progress`, 0 … 1 of all epochs: YOLOX's "yoloxwarmcos"."""
        greatest = self.lr_per_pair * self.batch
        warm, last = 1 / 36, 32 / 36
        if progress < warm:
            return greatest * (progress / warm) ** 2
        falling = min(1.0, (progress - warm) / (last - warm))
        return greatest * (_LAST_SHARE + (1 - _LAST_SHARE) * 0.5 * (1 + math.cos(math.pi * falling)))


@dataclass(frozen=True, slots=True)
class Epoch:
    """An epoch's mean loss of a pair, and the evaluator's scores; number 0 is the start, without a loss."""

    # `n_left_out` counts sequences without usable frames, boxes or scale ratio; the rate is the last step's.

    number: int
    n_left_out: int
    loss: float | None
    mid: float
    rte: float
    mid_by_range: dict[str, float | None]
    learning_rate: float | None = None


@dataclass(frozen=True, eq=False)
class Validation:
    source: Source

    def scores(self, operations: TorchLayers, *, use: Use) -> dict[str, Any]:
        """Return the evaluator's means by metric and TTC range."""
        truth = self.source.truth
        scale_ratios = [self._scale_ratio(operations, row, use=use) for row in range(truth.n_sequences)]
        ttc_s = scale_ratio_to_ttc(scale_ratios, fps_hz=fps_of_gap(5))
        report = evaluate(Predictions.from_arrays(ttc_s=ttc_s, manifest=truth.manifest), truth)
        return {name: score.means for name, score in report.scores.items()}

    def _scale_ratio(self, operations: TorchLayers, row: int, *, use: Use) -> float:
        """Estimate α, or the fallback of `tsttc baseline run`: the root of the boxes' areas, or 1."""
        try:
            pair = usable_pair(self.source, row, scale_ratio=1.0)
        except Unusable:
            boxes = self.source.clip(row).boxes
            try:
                return scale_ratio_of_two(boxes[0], boxes[5], measure="sqrt-area")
            except Unusable:
                return 1.0
        frames = pair.reference, pair.target
        with torch.no_grad():
            logits = network_logits(operations, [cut(frames, pair.boxes, use=use)], use=use)
            scale_ratio = float(mean_scale_ratio(logits)[0])
            if use.decoding == "fit":
                scale_ratio = fitted_scale_ratio(operations, frames, pair.boxes, near=scale_ratio)
        return scale_ratio


def mean_scale_ratio(logits: torch.Tensor) -> torch.Tensor:
    """Compute α̂ (b,) from logits (b, 20): the mean of the best, weighted by confidence."""
    best = torch.sigmoid(logits).topk(N_TOP, dim=1)
    scales = torch.as_tensor(network_scales(), dtype=torch.float32, device=logits.device)
    return (best.values * scales[best.indices]).sum(1) / best.values.sum(1)


def labels(scale_ratios: Sequence[float]) -> Floats:
    """Return the soft labels (b, 20); each row adds up to 1."""
    scales = network_scales()
    distance = np.abs(np.subtract.outer(np.asarray(scale_ratios), scales)) / (scales[1] - scales[0])
    return np.asarray(np.maximum(0.0, 1.0 - distance))


def new_tensors(*, seed: int) -> dict[str, torch.Tensor]:
    """Draw initial weights: Kaiming's; the linear layer passes on the greatest similarity."""
    generator = torch.Generator().manual_seed(seed)
    tensors = {}
    for name, shape in SHAPES.items():
        if name.endswith(("bn.weight", "running_var")):
            tensors[name] = torch.ones(shape)
        elif len(shape) == 4:
            bound = 1 / math.sqrt(math.prod(shape[1:]))
            tensors[name] = torch.empty(shape).uniform_(-bound, bound, generator=generator)
        else:
            tensors[name] = torch.zeros(shape)
    n = len(network_scales())
    tensors["head.scale_preds.weight"] = 20 * (torch.eye(n) - 1 / n)
    tensors["head.scale_preds.bias"] = torch.full((n,), -2.0)
    return tensors


class Network:
    """The tensors of a learning network, and its optimizer."""

    def __init__(self, tensors: dict[str, torch.Tensor], *, recipe: Recipe, device: str) -> None:
        self.recipe = recipe
        self.tensors = {name: tensor.to(device) for name, tensor in tensors.items()}
        learned = {name: tensor for name, tensor in self.tensors.items() if "running" not in name}
        for tensor in learned.values():
            tensor.requires_grad_()
        self._learned = list(learned.values())
        groups = [
            {"params": [t for t in self._learned if t.ndim == 4], "weight_decay": recipe.weight_decay},
            {"params": [t for t in self._learned if t.ndim != 4], "weight_decay": 0.0},
        ]
        self.optimizer: Any
        if recipe.optimizer == "sgd":
            self.optimizer = torch.optim.SGD(groups, lr=0.0, momentum=_MOMENTUM, nesterov=True)
        else:
            self.optimizer = torch.optim.AdamW(groups, lr=0.0, betas=(0.9, 0.98))

    def learn(self, samples: Sequence[Sample], *, learning_rate: float) -> float:
        """Take one step; return the mean loss of a pair."""
        for group in self.optimizer.param_groups:
            group["lr"] = learning_rate
        logits = network_logits(
            TorchLayers(self.tensors, training=True),
            [sample.crops for sample in samples],
            use=self.recipe.use,
        )
        loss = _loss(
            logits, [sample.scale_ratio for sample in samples], ratio_weight=self.recipe.ratio_weight
        )
        self.optimizer.zero_grad()
        fits = [sample.fit for sample in samples if sample.fit is not None]
        error = self._learn_to_fit(fits) if fits else 0.0
        loss.backward()
        length = torch.nn.utils.clip_grad_norm_(self._learned, MAX_GRADIENT)
        if bool(torch.isfinite(length)):
            self.optimizer.step()
        return float(loss.detach()) + self.recipe.fit_weight * error

    def _learn_to_fit(self, samples: Sequence[FitSample]) -> float:
        """Add the gradients of the fit's mean error in MiD, and return that error."""
        # As in inference, each pair is a batch of its own, of its own size.
        operations = TorchLayers(self.tensors)
        learned = [
            tensor
            for name, tensor in self.tensors.items()
            if tensor.requires_grad and name.startswith("backbone.")
        ]

        def one(sample: FitSample) -> tuple[float, Sequence[torch.Tensor]]:
            error = fit_error(operations, sample) / len(samples)
            return float(error.detach()), torch.autograd.grad(self.recipe.fit_weight * error, learned)

        with _one_thread_each() as n_threads, ThreadPoolExecutor(n_threads) as threads:
            errors, gradients = zip(*threads.map(one, samples), strict=True)
        for tensor, *parts in zip(learned, *gradients, strict=True):
            tensor.grad = torch.stack(parts).sum(0)
        return float(sum(errors))

    def operations(self) -> TorchLayers:
        return TorchLayers({name: tensor.detach() for name, tensor in self.tensors.items()})

    def weights(self, *, card: dict[str, Any]) -> Weights:
        tensors = {name: tensor.detach().cpu().numpy().copy() for name, tensor in self.tensors.items()}
        return Weights(tensors, self.recipe.use, card)


@contextmanager
def _one_thread_each() -> Iterator[int]:
    n_threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield n_threads
    finally:
        torch.set_num_threads(n_threads)


def _loss(logits: torch.Tensor, scale_ratios: Sequence[float], *, ratio_weight: float) -> torch.Tensor:
    wanted = torch.as_tensor(labels(scale_ratios), dtype=torch.float32, device=logits.device)
    loss = F.binary_cross_entropy_with_logits(logits, wanted, reduction="sum") / len(scale_ratios)
    if ratio_weight:
        true = torch.as_tensor(scale_ratios, dtype=torch.float32, device=logits.device)
        loss = loss + ratio_weight * (mean_scale_ratio(logits).log() - true.log()).abs().mean()
    return loss


def fit_error(operations: TorchLayers, sample: FitSample) -> torch.Tensor:
    """Compute a step's error in MiD; large errors count less."""
    target, reference = (evened(maps) for maps in features(operations, operations.constant(sample.pixels)))
    rows, columns = (operations.constant(offsets) for offsets in sample.grid.offsets())
    design, errors = equations(torch, target, reference, grid=sample.grid, offsets=(rows, columns))
    metric, weights = weighting(torch, design.detach(), errors.detach())
    step = solution(torch, metric @ design, metric @ errors, weights)
    error = _MID_OF_FIT * (step[0] - sample.lacking).abs()
    beyond = _OUTLIER_MID * (1 + (error.clamp(min=1.0) / _OUTLIER_MID).log())
    return torch.where(error < _OUTLIER_MID, error, beyond)


def train(
    *,
    source: Source,
    validation: Validation,
    recipe: Recipe,
    out: Path,
    start: Weights | None = None,
    device: str = "cpu",
    progress: Progress = lambda _n_done: None,
    after_epoch: Callable[[Sequence[Epoch]], None] = lambda _epochs: None,
) -> list[Epoch]:
    """Train, and write the weights of the epoch with the least MiD to `out`.

    A `start` is scored as epoch 0, with `recipe.use`, which should be its own. `progress` gets the number of
    trained sequences of all epochs, `after_epoch` the epochs until then, and before the first those of an
    interrupted training. That leaves `out` with `.part`; the same call continues after the last whole epoch.
    Raises `Rejected` if no sequence is usable, `DeviceMissing` and `OSError`.
    """
    if device == "cuda" and not torch.cuda.is_available():
        raise DeviceMissing
    key = _key(source, recipe, start)
    part = out.with_name(out.name + ".part")
    network, epochs = _begun(part, key=key, recipe=recipe, start=start, device=device)
    if start is not None and not epochs:
        scores = validation.scores(network.operations(), use=recipe.use)
        epochs.append(_epoch(scores, number=0, losses=(), n_left_out=0))
    after_epoch(tuple(epochs))
    n_rows = source.truth.n_sequences
    n_before = epochs[-1].number if epochs else 0
    n_done = n_before * n_rows
    progress(n_done)
    for number in range(n_before, recipe.epochs):
        rng = np.random.default_rng([recipe.seed, number])
        losses: list[float] = []
        fitting = network.operations() if recipe.fit_weight else None
        for n_new, samples in batches(source, use=recipe.use, size=recipe.batch, rng=rng, fitting=fitting):
            rate = recipe.learning_rate(n_done / (recipe.epochs * n_rows))
            losses += [network.learn(samples, learning_rate=rate)] * len(samples)
            n_done += n_new
            progress(n_done)
        if not losses:
            message = (
                f"None of the {n_rows:,} sequences can be learned from; expected some with both frames, both "
                "boxes, and a time to contact below −1.5 s or above 0.93 s."
            )
            raise reject("empty", message)
        n_done = (number + 1) * n_rows
        scores = validation.scores(network.operations(), use=recipe.use)
        n_left_out = n_rows - len(losses)
        epoch = _epoch(scores, number=number + 1, losses=losses, n_left_out=n_left_out, learning_rate=rate)
        is_best = all(epoch.mid <= earlier.mid for earlier in epochs if earlier.number)
        epochs.append(epoch)
        if is_best:
            write_weights(out, network.weights(card=card_of(recipe, source, epochs)))
        _keep(part, key=key, network=network, epochs=epochs)
        after_epoch(tuple(epochs))
    part.unlink(missing_ok=True)
    return epochs


def _epoch(
    scores: dict[str, Any],
    *,
    number: int,
    losses: Sequence[float],
    n_left_out: int,
    learning_rate: float | None = None,
) -> Epoch:
    overall = scores.pop("overall")
    by_range = {name: means["mid"] for name, means in scores.items()}
    loss = float(np.mean(losses)) if losses else None
    return Epoch(
        number, n_left_out, loss, float(overall["mid"]), float(overall["rte"]), by_range, learning_rate
    )


def card_of(recipe: Recipe, source: Source, epochs: Sequence[Epoch]) -> dict[str, Any]:
    return {
        "recipe": {name: value for name, value in asdict(recipe).items() if name != "use"},
        "data": {"sequences": int(source.truth.n_sequences), "digest": source.truth.digest},
        "torch": torch.__version__,
        "epochs": [asdict(epoch) for epoch in epochs],
    }


def _key(source: Source, recipe: Recipe, start: Weights | None) -> str:
    named = hashlib.sha256(json.dumps([asdict(recipe), source.truth.digest, torch.__version__]).encode())
    for tensor in start.tensors.values() if start else ():
        named.update(tensor.tobytes())
    return named.hexdigest()


def _begun(
    part: Path, *, key: str, recipe: Recipe, start: Weights | None, device: str
) -> tuple[Network, list[Epoch]]:
    """Return the network after this training's last whole epoch, and its epochs."""
    try:
        state = torch.load(part, map_location=device, weights_only=True)
    except (OSError, RuntimeError, ValueError, EOFError, pickle.UnpicklingError):
        state = None
    if isinstance(state, dict) and state.get("key") == key:
        network = Network(state["tensors"], recipe=recipe, device=device)
        network.optimizer.load_state_dict(state["optimizer"])
        return network, [Epoch(**epoch) for epoch in state["epochs"]]
    if start is None:
        tensors = new_tensors(seed=recipe.seed)
    else:
        tensors = {name: torch.from_numpy(values.copy()) for name, values in start.tensors.items()}
    return Network(tensors, recipe=recipe, device=device), []


def _keep(part: Path, *, key: str, network: Network, epochs: Sequence[Epoch]) -> None:
    new = part.with_name(part.name + ".new")
    state = {
        "key": key,
        "tensors": {name: tensor.detach() for name, tensor in network.tensors.items()},
        "optimizer": network.optimizer.state_dict(),
        "epochs": [asdict(epoch) for epoch in epochs],
    }
    torch.save(state, new)
    new.replace(part)
