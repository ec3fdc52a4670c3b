"""RoI align (He et al., Mask R-CNN, 2017) as two matrix products: rows of the map, then columns.

As torchvision with `aligned=False`, `sampling_ratio=-1`: a cell is the mean of ceil(box side / cells)
bilinear samples per direction; a sample before −1 or after the map's length is 0, and between there and the
edge takes the edge's value.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def sampling_matrix(low: float, high: float, *, n_cells: int, length: int) -> NDArray[np.float64]:
    """Return (n_cells, length): the matrix of means in the cells of `low` to `high` on one axis.

    A box narrower than 1 counts as 1 wide, as in torchvision.

    >>> sampling_matrix(0.0, 2.0, n_cells=2, length=3).tolist()
    [[0.5, 0.5, 0.0], [0.0, 0.5, 0.5]]
    """
    side = max(high - low, 1.0)
    n_samples = max(1, math.ceil(side / n_cells))
    cell = side / n_cells
    offsets = (np.arange(n_samples) + 0.5) / n_samples
    samples = low + cell * (np.arange(n_cells)[:, np.newaxis] + offsets)
    inside = (samples >= -1.0) & (samples <= length)
    clamped = np.clip(samples, 0.0, length - 1)
    below = np.minimum(clamped.astype(np.intp), length - 1)
    above = np.minimum(below + 1, length - 1)
    part = clamped - below
    matrix = np.zeros((n_cells, length))
    cells = np.broadcast_to(np.arange(n_cells)[:, np.newaxis], samples.shape)
    np.add.at(matrix, (cells, below), inside * (1 - part))
    np.add.at(matrix, (cells, above), inside * part)
    return matrix / n_samples
