"""Deep Scale as a baseline: the network on the crops of a pair, and the scale ratio of its answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from tsttc_baselines.clips import TARGET, Clip, Image
from tsttc_baselines.deep_scale.crops import Crop, CropPair, cut_pair
from tsttc_baselines.deep_scale.fit import fitted_scale_ratio
from tsttc_baselines.deep_scale.layers import NumpyLayers
from tsttc_baselines.deep_scale.network import Array, Operations, Sampling, features, similarities
from tsttc_baselines.deep_scale.weights import N_SCALES, Decoding, Use, Weights, read_weights
from tsttc_baselines.estimates import Estimate
from tsttc_baselines.methods import OWN_WEIGHTS
from tsttc_baselines.patches import boxes_of_pair, require_centre_inside
from tsttc_baselines.scales import best_of, scale_bins

Floats = NDArray[np.float64]
Pixels = NDArray[np.float32]

N_TOP: Final = 4
"""Best scale ratios that are averaged (§5.2)."""

Device = Literal["numpy", "cpu", "cuda"]

_FRAME_GAP: Final = 5
"""The weights are for the scale ratios of this gap. They hold at any other: a pair does not show its gap."""


class DeepScale:
    """The baseline with the package's weights, or those of a file.

    `device` is "numpy", or "cpu" or "cuda" by torch. `decoding` makes the scale ratio: "head" is the paper's
    mean of the four best of 20, "fit" refines it by matching features (`fit`), "auto" is the card's; the
    toolkit's weights have the head. Raises `Rejected` for faulty weights, `OSError`, and `ValueError` for a
    missing device.
    """

    def __init__(
        self,
        *,
        weights: Path = OWN_WEIGHTS,
        device: Device = "numpy",
        decoding: Literal["auto"] | Decoding = "auto",
    ) -> None:
        loaded = read_weights(weights)
        self._use = loaded.use if decoding == "auto" else replace(loaded.use, decoding=decoding)
        self.used = {"decoding": self._use.decoding}
        self._scales = network_scales()
        self._operations = operations_on(device, loaded)

    def __call__(self, clip: Clip, *, frame_gap: int) -> Estimate:
        """Estimate α; raises `Unusable` for a box that is missing, too small or centred outside the image."""
        frames, boxes = _usable(clip, frame_gap=frame_gap)
        confidences = self.confidences(cut(frames, boxes, use=self._use))
        best = best_of(-confidences, n_top=N_TOP)
        scale_ratio = float(np.average(self._scales[best], weights=confidences[best]))
        if self._use.decoding == "fit":
            scale_ratio = fitted_scale_ratio(self._operations, frames, boxes, near=scale_ratio)
        return Estimate(scale_ratio, confidence=float(confidences[best[0]]))

    def crops(self, clip: Clip, *, frame_gap: int) -> CropPair:
        return cut(*_usable(clip, frame_gap=frame_gap), use=self._use)

    def confidences(self, pair: CropPair) -> Floats:
        """Return the confidence of each scale ratio, (20,), 0 to 1."""
        logits = self._operations.values(network_logits(self._operations, [pair], use=self._use))[0]
        return np.asarray(0.5 + 0.5 * np.tanh(0.5 * logits.astype(np.float64)))


def _usable(clip: Clip, *, frame_gap: int) -> tuple[tuple[Image, Image], tuple[Floats, Floats]]:
    boxes = boxes_of_pair(clip, frame_gap=frame_gap)
    frames = clip.colour(TARGET - frame_gap), clip.colour(TARGET)
    for image, box, name in zip(frames, boxes, ("reference", "target"), strict=True):
        require_centre_inside(image, box, name=name)
    return frames, boxes


def network_scales() -> Floats:
    return scale_bins(frame_gap=_FRAME_GAP, n_bins=N_SCALES)


def cut(frames: tuple[Image, Image], boxes: tuple[Floats, Floats], *, use: Use) -> CropPair:
    return cut_pair(
        *frames,
        boxes,
        max_scale=float(network_scales()[-1]),
        max_box_px=use.max_box_px,
        margin_px=use.margin_px,
        n_cells=use.n_cells,
    )


def network_logits(operations: Operations, pairs: Sequence[CropPair], *, use: Use) -> Array:
    """Compute the network's outputs (b, 20) before the sigmoid, as an array of the operations."""
    target, reference = (
        features(operations, operations.constant(stacked(crops)))
        for crops in ([pair.target for pair in pairs], [pair.reference for pair in pairs])
    )
    sampling = [
        Sampling.of(
            target_box=pair.target.box,
            reference_box=pair.reference.box,
            n_cells=use.n_cells,
            scales=network_scales(),
            target_shape=target.shape[2:],
            reference_shape=reference.shape[2:],
        )
        for pair in pairs
    ]
    head_input = similarities(operations, target, reference, sampling, similarity=use.similarity)
    return operations.linear("head.scale_preds", head_input)


def stacked(crops: Sequence[Crop]) -> Pixels:
    """Stack crops (b, 3, h, w), with borders repeated on smaller ones."""
    height, width = (max(crop.pixels.shape[axis] for crop in crops) for axis in (0, 1))
    wide = [
        np.pad(
            crop.pixels,
            ((0, height - crop.pixels.shape[0]), (0, width - crop.pixels.shape[1]), (0, 0)),
            mode="edge",
        )
        for crop in crops
    ]
    return np.stack(wide).transpose(0, 3, 1, 2)


def operations_on(device: Device, weights: Weights) -> Operations:
    """Make the network's operations; raises `ValueError` for a missing device."""
    if device == "numpy":
        return NumpyLayers(weights.tensors)
    if find_spec("torch") is None:
        raise ValueError(f"--device {device} needs torch; install it with: pip install torch")
    import torch  # noqa: PLC0415 -- an extra, which numpy can do without

    from tsttc_baselines.deep_scale.torch_layers import TorchLayers  # noqa: PLC0415 -- as above

    if device == "cuda" and not torch.cuda.is_available():
        raise ValueError(
            "--device cuda needs a graphics card that torch can use; expected cpu or numpy here."
        )
    if device == "cpu":
        torch.set_num_threads(1)  # sequences are spread over processes, and the layers are small
    tensors = {name: torch.from_numpy(values).to(device) for name, values in weights.tensors.items()}
    return TorchLayers(tensors)
