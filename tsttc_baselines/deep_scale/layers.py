"""The network's operations in numpy: convolutions as matrix products, batch norms folded in."""

# Images are (b, channels, h, w), but channels come last in memory: the patches of a row are one matrix.

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Floats = NDArray[np.float32]

BN_EPSILON: Final = 1e-3
"""Added to a variance before its root; YOLOX's."""

LEAST_NORM: Final = 1e-12
"""Added to a squared norm, so that a vector of 0 can be divided by it."""

_NORM: Final = ("weight", "bias", "running_mean", "running_var")
_MAX_STRIP: Final = 2**20
"""Numbers of a convolution's patches that are laid out at once; more leave the processor's cache."""


@dataclass(frozen=True, eq=False)
class NumpyLayers:
    tensors: Mapping[str, Floats]

    @cached_property
    def _folded(self) -> dict[str, tuple[Floats, Floats]]:
        """Fold batch norm into each block's kernel (k, k · channels, channels out) and bias."""
        folded = {}
        for key, weight in self.tensors.items():
            name, is_conv, _ = key.partition(".conv.weight")
            if not is_conv:
                continue
            norm = {part: self.tensors[f"{name}.bn.{part}"].astype(np.float64) for part in _NORM}
            gain = norm["weight"] / np.sqrt(norm["running_var"] + BN_EPSILON)
            kernel = (weight * gain[:, None, None, None]).transpose(2, 3, 1, 0)
            rows = kernel.reshape(len(kernel), -1, len(weight)).astype(np.float32)
            folded[name] = (rows, (norm["bias"] - gain * norm["running_mean"]).astype(np.float32))
        return folded

    def block(self, name: str, images: Floats, *, stride: int = 1) -> Floats:
        kernel, bias = self._folded[name]
        outputs = [convolved(each, kernel, bias, stride=stride) for each in _channels_last(images)]
        return _channels_first(silu(np.stack(outputs)))

    def upsampled(self, name: str, images: Floats) -> Floats:
        kernel, bias = self.tensors[f"{name}.weight"], self.tensors[f"{name}.bias"]
        return _channels_first(doubled(_channels_last(images), kernel) + bias)

    def joined(self, one: Floats, other: Floats) -> Floats:
        return _channels_first(np.concatenate([_channels_last(one), _channels_last(other)], axis=-1))

    def constant(self, values: NDArray[Any]) -> Floats:
        return values.astype(np.float32)

    def permuted(self, values: Floats, axes: tuple[int, ...]) -> Floats:
        return values.transpose(axes)

    def unit(self, vectors: Floats, *, axis: int) -> Floats:
        squares = np.square(vectors).sum(axis=axis, keepdims=True)
        return np.asarray(vectors / np.sqrt(squares + np.float32(LEAST_NORM)))

    def greatest(self, values: Floats) -> Floats:
        return np.asarray(values.max(axis=-1))

    def linear(self, name: str, values: Floats) -> Floats:
        return np.asarray(values @ self.tensors[f"{name}.weight"].T + self.tensors[f"{name}.bias"])

    def values(self, array: Floats) -> Floats:
        return array


def _channels_last(images: Floats) -> Floats:
    return np.ascontiguousarray(images.transpose(0, 2, 3, 1))


def _channels_first(images: Floats) -> Floats:
    return images.transpose(0, 3, 1, 2)


def silu(values: Floats) -> Floats:
    """Compute x / (1 + exp(−x)) in place."""
    with np.errstate(over="ignore"):  # exp(−x) = ∞ gives the right 0
        values /= 1 + np.exp(-values)
    return values


def convolved(image: Floats, kernel: Floats, bias: Floats, *, stride: int = 1) -> Floats:
    """Convolve `image` (h, w, channels) with zeros around it, to (h, w, channels out)."""
    # `kernel` is (k, k · channels, channels out). The image's rows are laid out once as patches of 1 × k, and
    # each row of the kernel multiplies them.
    size, channels = len(kernel), image.shape[2]
    if size == 1:
        return np.asarray(image @ kernel[0] + bias)
    pad = size // 2
    height, width = (-(-side // stride) for side in image.shape[:2])
    padded = np.pad(image, ((pad, pad), (pad, pad), (0, 0)))
    output = np.empty((height, width, kernel.shape[2]), dtype=np.float32)
    n_rows = max(1, _MAX_STRIP // (width * size * channels * stride))
    for first in range(0, height, n_rows):
        last = min(height, first + n_rows)
        rows = padded[first * stride : (last - 1) * stride + size]
        patches = sliding_window_view(rows.reshape(len(rows), -1), size * channels, axis=1)
        patches = np.ascontiguousarray(patches[:, :: stride * channels][:, :width])
        strip = output[first:last]
        strip[:] = bias
        for row, part in enumerate(kernel):
            strip += patches[row : row + (last - first - 1) * stride + 1 : stride] @ part
    return output


def doubled(images: Floats, kernel: Floats) -> Floats:
    """Apply a transposed 3×3 convolution of stride 2: (b, h, w, channels) to (b, 2h, 2w, channels out)."""
    # Padding 1, output padding 1. An even output position sees the kernel's middle, an odd one its two ends.
    b, height, width, _ = images.shape
    output = np.empty((b, 2 * height, 2 * width, kernel.shape[1]), dtype=np.float32)
    after = np.pad(images, ((0, 0), (0, 1), (0, 1), (0, 0)))
    ends = {0: ((1, 0),), 1: ((2, 0), (0, 1))}
    for odd_row, rows in ends.items():
        for odd_column, columns in ends.items():
            output[:, odd_row::2, odd_column::2] = sum(
                after[:, down : down + height, right : right + width] @ kernel[:, :, row, column]
                for row, down in rows
                for column, right in columns
            )
    return output
