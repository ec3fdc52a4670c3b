"""The paper's baselines, runnable on folders of frames and boxes, and the renderer that makes such folders.

    from tsttc_baselines.pixel_mse import PixelMse
    estimate = PixelMse()(clip, frame_gap=5)

Frames: `folders`, `images`, `clips`, `boxes`, `rendering`. Methods: `methods`, `own_methods`, `running`,
`estimates`, `detection`, `pixel_mse`, `alignment`, `tracking`, `deep_scale`. Networks: `torch`, `pairs`.

Imports the evaluator, never Django; the evaluator never imports it. OpenCV comes with
`pip install '.[baselines]'`.
"""

import os
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

# Sequences are spread over processes. Products of small matrices are slower with threads, on a busy machine
# ten times. This takes effect where numpy is not imported yet: in `tsttc` and the processes that it starts.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

__all__ = [
    "alignment",
    "boxes",
    "clips",
    "deep_scale",
    "detection",
    "estimates",
    "folders",
    "images",
    "methods",
    "own_methods",
    "pairs",
    "pixel_mse",
    "rendering",
    "running",
    "torch",
    "tracking",
]


def __dir__() -> list[str]:
    return sorted(__all__)


if not TYPE_CHECKING:  # a type checker reads the modules themselves

    def __getattr__(name: str) -> ModuleType:
        # As late as possible: nearly all of them load OpenCV.
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        try:
            return import_module(f"{__name__}.{name}")
        except ModuleNotFoundError as missing:  # of an extra; `help` goes on to the next
            raise AttributeError(str(missing), name=name) from missing
