"""The network (§5.2): features of two crops, sampled for each scale ratio, and compared.

It is written once, over the operations that `layers` has in numpy and `torch_layers` in torch:

    image (3, h, w), blue, green and red from 0 to 255
      stem     convolution 7×7, stride 2, to 12 channels
      stage 2  convolution 7×7 to 24 channels, and a CSP layer of three bottlenecks
      upsample transposed convolution 3×3, stride 2
      stage 3  two convolutions 7×7
    features (24, h, w)

The target's features are sampled in 50×50 cells of its box, the paper's "target size". For each scale ratio
α, the reference's are sampled in 52×52 cells of a box α times the target's size about the reference's centre,
so that nine windows of 50×50 cells fit: shifts by up to one cell. The similarity of α is the greatest of the
nine. A linear layer and a sigmoid turn the similarities into confidences.
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
    """The operations, by numpy or torch. Names are those of the weights; images are (b, c, h, w)."""

    def block(self, name: str, images: Array, *, stride: int = 1) -> Array:
        """Convolution, batch normalisation and SiLU. The size is kept, or halved and rounded up."""
        ...

    def upsampled(self, name: str, images: Array) -> Array:
        """Transposed convolution 3×3, stride 2: twice the size."""
        ...

    def joined(self, one: Array, other: Array) -> Array:
        """The channels of both."""
        ...

    def constant(self, values: NDArray[Any]) -> Array:
        """These numbers as an array."""
        ...

    def permuted(self, values: Array, axes: tuple[int, ...]) -> Array:
        """The same with its axes in this order."""
        ...

    def unit(self, vectors: Array, *, axis: int) -> Array:
        """The vectors along an axis divided by their norms; vectors of 0 stay."""
        ...

    def greatest(self, values: Array) -> Array:
        """The maximum along the last axis."""
        ...

    def linear(self, name: str, values: Array) -> Array:
        """The linear layer on the last axis."""
        ...

    def values(self, array: Array) -> NDArray[np.float32]:
        """An array's numbers, for numpy."""
        ...


def features(operations: Operations, images: Array) -> Array:
    """(b, 24, h, w): the features of `images` (b, 3, h, w); h and w are even."""
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
    """The sampling of one pair's features: matrices as `roi_align.sampling_matrix` makes them.

    The target's are (3 · 52, h) and (3 · 52, w), for the three shifts one below the other: 50 cells with a
    border of zeros, whose place is the shift. The reference's are (n, 52, h) and (n, 52, w), one for each
    scale ratio.
    """

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
        """For boxes (4,) in pixels of the two crops, whose shapes are (h, w).

        Both boxes have the target's size; the reference's is multiplied by each of the `scales` (n,).
        """
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
    """(3 · 52, length): the cells' matrix with zeros around it, at the three shifts."""
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
    """(b, n): how alike the features (b, 24, h, w) of target and reference are at each scale ratio.

    "dot" is the mean over the cells of the scalar product of two feature vectors, "cosine" that of their
    cosine.
    """

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
