"""The network (§5.2): features of two crops, sampled for each scale ratio, and compared.

    image (3, h, w), blue, green and red from 0 to 255
      stem     convolution 7×7, stride 2, to 12 channels
      stage 2  convolution 7×7 to 24 channels, and a CSP layer of three bottlenecks
      upsample transposed convolution 3×3, stride 2
      stage 3  two convolutions 7×7
    features (24, h, w)

The target is sampled in 50×50 cells of its box; for each scale ratio α, the reference in 52×52 cells of a box
α times the target's size about the reference's centre. The similarity of α is the greatest of nine shifts; a
linear layer and a sigmoid make confidences. `layers` (numpy) and `torch_layers` have the operations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from tsttc_baselines.boxes import expand
from tsttc_baselines.deep_scale.roi_align import sampling_matrix

Floats = NDArray[np.float64]
Array = Any
"""An array of the operations, numpy's or torch's, in float32."""

MAX_SHIFT: Final = 1
"""The paper's c, in cells."""

_N_BOTTLENECKS: Final = 3
_N_SHIFTS: Final = 2 * MAX_SHIFT + 1

Similarity = Literal["dot", "cosine"]


class Operations(Protocol):
    """The operations, by numpy or torch, named as the weights; images are (b, c, h, w)."""

    def block(self, name: str, images: Array, *, stride: int = 1) -> Array:
        """Convolve, normalise and apply SiLU; the size stays, or is halved and rounded up."""
        ...

    def upsampled(self, name: str, images: Array) -> Array:
        """Apply the transposed convolution 3×3, stride 2."""
        ...

    def joined(self, one: Array, other: Array) -> Array: ...

    def constant(self, values: NDArray[Any]) -> Array: ...

    def permuted(self, values: Array, axes: tuple[int, ...]) -> Array: ...

    def unit(self, vectors: Array, *, axis: int) -> Array:
        """Normalise vectors along an axis; zeros stay."""
        ...

    def greatest(self, values: Array) -> Array:
        """Take the maximum along the last axis."""
        ...

    def linear(self, name: str, values: Array) -> Array:
        """Apply the linear layer to the last axis."""
        ...

    def values(self, array: Array) -> NDArray[np.float32]: ...


def features(operations: Operations, images: Array) -> Array:
    """Compute features (b, 24, h, w) of `images` (b, 3, h, w); h and w are even."""
    maps = operations.block("backbone.stem", images, stride=2)
    maps = operations.block("backbone.stage2.0", maps)
    deep = operations.block("backbone.stage2.1.conv1", maps)
    for number in range(_N_BOTTLENECKS):
        name = f"backbone.stage2.1.m.{number}"
        deep = operations.block(f"{name}.conv2", operations.block(f"{name}.conv1", deep)) + deep
    flat = operations.block("backbone.stage2.1.conv2", maps)
    maps = operations.block("backbone.stage2.1.conv3", operations.joined(deep, flat))
    maps = operations.upsampled("backbone.upsample", maps)
    return operations.block("backbone.stage3.1", operations.block("backbone.stage3.0", maps))


@dataclass(frozen=True, slots=True, eq=False)
class Sampling:
    """Matrices of a pair from `roi_align.sampling_matrix`: target (3 · 52, h or w), reference (n, 52, …)."""

    # The target's are three shifts of 50 cells with a border of zeros; the reference's are by scale ratio.

    target_rows: Floats
    target_columns: Floats
    reference_rows: Floats
    reference_columns: Floats

    @classmethod
    def of(
        cls,
        *,
        target_box: Floats,
        reference_box: Floats,
        n_cells: int,
        scales: Floats,
        target_shape: tuple[int, int],
        reference_shape: tuple[int, int],
    ) -> Sampling:
        """Make the matrices for boxes (4,) of the target's size, in pixels of crops of shape (h, w)."""
        n_sampled = n_cells + 2 * MAX_SHIFT
        boxes = expand(reference_box, scales * (n_sampled / n_cells))
        rows, columns = (
            (
                _placed(
                    target_box[axis], target_box[axis + 2], n_cells=n_cells, length=target_shape[1 - axis]
                ),
                np.stack(
                    [
                        sampling_matrix(
                            box[axis], box[axis + 2], n_cells=n_sampled, length=reference_shape[1 - axis]
                        )
                        for box in boxes
                    ]
                ),
            )
            for axis in (1, 0)
        )
        return cls(rows[0], columns[0], rows[1], columns[1])


def _placed(low: float, high: float, *, n_cells: int, length: int) -> Floats:
    """Put zeros around a matrix of cells, at the three shifts, (3 · 52, length)."""
    matrix = sampling_matrix(low, high, n_cells=n_cells, length=length)
    placed = np.zeros((_N_SHIFTS, n_cells + 2 * MAX_SHIFT, length))
    for shift in range(_N_SHIFTS):
        placed[shift, shift : shift + n_cells] = matrix
    return placed.reshape(-1, length)


def similarities(
    operations: Operations,
    target: Array,
    reference: Array,
    sampling: Sequence[Sampling],
    *,
    similarity: Similarity,
) -> Array:
    """Compare features (b, 24, h, w) of target and reference at each scale ratio, (b, n)."""
    # The mean over cells of the scalar product ("dot") or of the "cosine" of two feature vectors.

    def stacked(name: str) -> Array:
        return operations.constant(np.stack([getattr(each, name) for each in sampling]))

    b, channels = target.shape[:2]
    seen = stacked("target_rows")[:, None] @ (target @ stacked("target_columns").swapaxes(1, 2)[:, None])
    columns = stacked("reference_columns")
    n, n_sampled = columns.shape[1:3]
    across = reference @ columns.reshape(b, n * n_sampled, -1).swapaxes(1, 2)[:, None]
    across = operations.permuted(across.reshape(b, channels, -1, n, n_sampled), (0, 3, 1, 2, 4))
    sampled = stacked("reference_rows")[:, :, None] @ across
    if similarity == "cosine":
        seen, sampled = operations.unit(seen, axis=1), operations.unit(sampled, axis=2)
    seen = seen.reshape(b, channels, _N_SHIFTS, n_sampled, _N_SHIFTS, n_sampled)
    seen = operations.permuted(seen, (0, 1, 3, 5, 2, 4)).reshape(b, -1, _N_SHIFTS**2)
    return operations.greatest(sampled.reshape(b, n, -1) @ seen) / (n_sampled - 2 * MAX_SHIFT) ** 2
