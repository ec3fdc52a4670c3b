"""The network's operations in torch (`pip install '.[train]'`), for training and graphics cards."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812 -- torch's own name for it
from numpy.typing import NDArray

from tsttc_baselines.deep_scale.layers import BN_EPSILON, LEAST_NORM

BN_MOMENTUM = 0.03
"""YOLOX's: how much a batch changes the running means that inference uses."""


@dataclass(frozen=True, eq=False)
class TorchLayers:
    """The operations with these tensors, by weight name; `training` normalises batches by their own means."""

    tensors: Mapping[str, torch.Tensor]
    training: bool = False

    def block(self, name: str, images: torch.Tensor, *, stride: int = 1) -> torch.Tensor:
        weight = self.tensors[f"{name}.conv.weight"]
        outputs = F.conv2d(images, weight, stride=stride, padding=weight.shape[-1] // 2)
        outputs = F.batch_norm(
            outputs,
            self.tensors[f"{name}.bn.running_mean"],
            self.tensors[f"{name}.bn.running_var"],
            self.tensors[f"{name}.bn.weight"],
            self.tensors[f"{name}.bn.bias"],
            training=self.training,
            momentum=BN_MOMENTUM,
            eps=BN_EPSILON,
        )
        return F.silu(outputs)

    def upsampled(self, name: str, images: torch.Tensor) -> torch.Tensor:
        weight, bias = self.tensors[f"{name}.weight"], self.tensors[f"{name}.bias"]
        return F.conv_transpose2d(images, weight, bias, stride=2, padding=1, output_padding=1)

    def joined(self, one: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
        return torch.cat((one, other), dim=1)

    def constant(self, values: NDArray[Any]) -> torch.Tensor:
        device = self.tensors["backbone.stem.conv.weight"].device
        # Crops lie with the channels last, as they stay here: convolutions are faster so.
        return torch.from_numpy(values.astype(np.float32, copy=False)).to(device)

    def permuted(self, values: torch.Tensor, axes: tuple[int, ...]) -> torch.Tensor:
        return values.permute(axes)

    def unit(self, vectors: torch.Tensor, *, axis: int) -> torch.Tensor:
        return vectors / (vectors.square().sum(axis, keepdim=True) + LEAST_NORM).sqrt()

    def greatest(self, values: torch.Tensor) -> torch.Tensor:
        return values.amax(-1)

    def linear(self, name: str, values: torch.Tensor) -> torch.Tensor:
        return F.linear(values, self.tensors[f"{name}.weight"], self.tensors[f"{name}.bias"])

    def values(self, array: torch.Tensor) -> NDArray[np.float32]:
        numbers: NDArray[np.float32] = array.detach().cpu().numpy()
        return numbers
