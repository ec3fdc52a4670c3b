"""The register of methods, for `tsttc baseline list` and `run`.

To add a method, write its estimator and add one row to `METHODS`; its parameters become options. Imports are
late.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

if TYPE_CHECKING:
    from tsttc_baselines.estimates import Estimator

Value = str | int | float | Path | None
"""The value of a parameter; None where it has no default and was not given."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of a method, and its option on the command line.

    - `name`: the name in Python, such as `bins`.
    - `default`: the value if none is given.
    - `help`: one sentence for `tsttc baseline list`.
    - `kind`: the type of the values.
    - `choices`: the values that are allowed; empty if any is.
    - `low`, `high`: the smallest and the largest value that are allowed; None for no limit.
    - `is_required`: whether a value must be given.
    """

    # Methods may share a name, with their own defaults but the same kind, choices and limits.

    name: str
    default: Value
    help: str
    kind: type[str] | type[int] | type[float] | type[Path] = str
    choices: tuple[str, ...] = ()
    low: float | None = None
    high: float | None = None
    is_required: bool = False

    @property
    def default_in_words(self) -> str | None:
        """The default as text, for a file only its name; None if there is no default."""
        if self.default is None:
            return None
        return self.default.name if isinstance(self.default, Path) else str(self.default)

    @property
    def option(self) -> str:
        """The option on the command line, such as `--bins`."""
        return "--" + self.name.replace("_", "-")


@dataclass(frozen=True, slots=True)
class Method:
    """A method that `tsttc baseline run` can run.

    - `name`: the name on the command line.
    - `title`, `summary`: the name and one sentence for people.
    - `factory`: "module:name" of a callable that takes the parameters as keywords and returns an `Estimator`.
    - `parameters`: the parameters with their defaults.
    - `published`: the paper's values of the parameters; None if the paper does not have the method.
    - `frames`: the images that it needs: "none", "pair" for the reference and the target frame, or "all" six.
    - `boxes`: the boxes that it needs: "pair", or only that of the "target".
    """

    name: str
    title: str
    summary: str
    factory: str
    parameters: tuple[Parameter, ...] = ()
    published: Mapping[str, Value] | None = None
    frames: Literal["none", "pair", "all"] = "pair"
    boxes: Literal["pair", "target"] = "pair"

    def filled(self, given: Mapping[str, Value]) -> dict[str, Value]:
        """Return all parameters: those `given`, and the defaults of the others.

        Raises `KeyError` for an unknown name, and `ValueError` for a missing or infinite value.
        """
        known = {parameter.name: parameter.default for parameter in self.parameters}
        strangers = [name for name in given if name not in known]
        if strangers:
            raise KeyError(strangers[0])
        for parameter in self.parameters:
            value = given.get(parameter.name)
            if isinstance(value, float) and not math.isfinite(value):
                raise ValueError(f"{parameter.option} is {value}; expected a finite number.")
            if parameter.is_required and value is None:
                raise ValueError(f"{self.name} needs {parameter.name}; give it with --set {parameter.name}=…")
        return known | dict(given)

    def provenance(self, parameters: Mapping[str, Value], *, digests: Mapping[str, str] | None = None) -> str:
        """Return "as published" for the paper's parameters, "variant" for others, "unpublished" without any.

        `digests` are the SHA-256 of files among the parameters, by which a published file is known.
        """
        if self.published is None:
            return "unpublished"
        files = {name: PUBLISHED_FILES.get(digest) for name, digest in (digests or {}).items()}
        given = {**parameters, **files}
        is_published = all(given[name] == value for name, value in self.published.items())
        return "as published" if is_published else "variant"

    def estimator(self, parameters: Mapping[str, Value]) -> Estimator:
        """Return the estimator with these parameters."""
        module, _, name = self.factory.partition(":")
        made: Estimator = getattr(import_module(module), name)(**parameters)
        return made


MEASURES: Final = ("area", "sqrt-area", "height", "width")
"""As in `tsttc_baselines.boxes`, which loads numpy."""

PUBLISHED_FILES: Final = {
    "aa6d986655ec395039fb16ec95a6b210330f9dedda28ad8ae9efe9c9e3375624": "Deep_TTC.pth",
}
"""Weights of published rows, by their SHA-256: the toolkit's checkpoint."""

OWN_WEIGHTS: Final = Path(__file__).parent / "deep_scale" / "rendered.npz"
"""The path of the weights that come with the package, trained on rendered frames."""

METHODS: Final[tuple[Method, ...]] = (
    Method(
        name="detection",
        title="Detection",
        summary="The ratio of the boxes' sizes. Looks at no image.",
        factory="tsttc_baselines.detection:Detection",
        parameters=(
            Parameter("measure", "area", "Size of a box whose ratio is the scale ratio.", choices=MEASURES),
        ),
        published={"measure": "area"},
        frames="none",
    ),
    Method(
        name="pixel-mse",
        title="Pixel MSE",
        summary="The scale at which the reference frame looks most like the target box.",
        factory="tsttc_baselines.pixel_mse:PixelMse",
        parameters=(
            Parameter(
                "variant",
                "paper",
                "The paper's wording, or what the toolkit's code does.",
                choices=("paper", "toolkit"),
            ),
            Parameter("bins", 125, "Scale ratios that are tried.", kind=int, low=2, high=400),
            Parameter("shift", 3, "Maximum shift of a patch, in its cells.", kind=int, low=0, high=16),
            Parameter("top", 3, "Best scale ratios that are averaged.", kind=int, low=1, high=400),
            Parameter("expand", 1.1, "Enlargement of the boxes.", kind=float, low=0.5, high=2.0),
            Parameter(
                "cells",
                64,
                "Most cells along the longer side of a patch; a cell is a pixel or more (paper's variant).",
                kind=int,
                low=16,
                high=256,
            ),
            Parameter(
                "search",
                "full",
                "All scale ratios at full detail, or first a few in coarse patches (paper's variant).",
                choices=("full", "coarse-to-fine"),
            ),
        ),
        # The paper's words and the toolkit's code differ; the published row is taken to be the code's.
        published={"variant": "toolkit", "bins": 125, "shift": 3, "top": 3, "expand": 1.1},
    ),
    Method(
        name="tracking",
        title="SOT",
        summary="The target box is followed back to the reference frame. The paper follows with OSTrack, "
        "which is not here.",
        factory="tsttc_baselines.tracking:Tracking",
        parameters=(
            # No choices: a tracker that cannot be used is refused with the reason.
            Parameter("tracker", "median-flow", "median-flow, csrt (opencv-contrib) or nano (with models)."),
            Parameter(
                "measure", "sqrt-area", "Size of a box whose ratio is the scale ratio.", choices=MEASURES
            ),
            Parameter("backbone", None, "NanoTrack's backbone (ONNX).", kind=Path),
            Parameter("head", None, "NanoTrack's head (ONNX).", kind=Path),
        ),
        published={"tracker": "ostrack", "measure": "area"},
        frames="all",
        boxes="target",
    ),
    Method(
        name="deep-scale",
        title="Deep Scale",
        summary="The paper's network, which compares features of both boxes at 20 scale ratios.",
        factory="tsttc_baselines.deep_scale.estimator:DeepScale",
        parameters=(
            Parameter(
                "weights", OWN_WEIGHTS, "Weights, of this project or the toolkit's checkpoint.", kind=Path
            ),
            Parameter(
                "device",
                "numpy",
                "What computes: numpy, or torch on cpu or cuda.",
                choices=("numpy", "cpu", "cuda"),
            ),
            Parameter(
                "decoding",
                "auto",
                "head: the head's mean over four scale ratios, as published; fit: a fit of the features; "
                "auto: as the card of the weights says, which is fit for ours.",
                choices=("auto", "head", "fit"),
            ),
        ),
        published={"weights": "Deep_TTC.pth", "decoding": "head"},
    ),
    Method(
        name="alignment",
        title="Photometric alignment",
        summary="Scale, shift, gain and offset under which the reference frame shows the target box.",
        factory="tsttc_baselines.alignment:Alignment",
        parameters=(
            Parameter("expand", 1.0, "Enlargement of the boxes.", kind=float, low=0.5, high=2.0),
            Parameter("samples", 64, "Samples along the longer side of a box.", kind=int, low=16, high=256),
        ),
    ),
)


def get_method(name: str) -> Method:
    """Return the method of this package with this name. Raises `KeyError` if there is none."""
    return {method.name: method for method in METHODS}[name]
