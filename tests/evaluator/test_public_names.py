"""What Tab and `help()` show of both packages: their public names, and nothing that they import."""

from __future__ import annotations

import subprocess
import sys

import pytest

import evaluator
import tsttc_baselines


def output_of(program: str) -> str:
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.parametrize("package", [evaluator, tsttc_baselines])
def test_completion_offers_the_public_names_before_the_first_use(package: object) -> None:
    name = getattr(package, "__name__", "")
    listed = output_of(f"import {name}; print(*dir({name}))").split()
    assert listed == sorted(evaluator.__all__ if package is evaluator else tsttc_baselines.__all__)


def test_docstrings_name_what_is_public() -> None:
    for package in (evaluator, tsttc_baselines):
        words = package.__doc__ or ""
        assert [name for name in package.__all__ if f"`{name}`" not in words and name != "__version__"] == []


@pytest.mark.slow
def test_help_describes_the_functions() -> None:
    text = output_of("import evaluator, pydoc; print(pydoc.render_doc(evaluator, renderer=pydoc.plaintext))")
    assert "read_predictions(" in text
    assert "class Report(" in text
    assert "__getattr__" not in text
    assert "pixel_mse" in output_of(
        "import tsttc_baselines, pydoc; print(pydoc.render_doc(tsttc_baselines, renderer=pydoc.plaintext))"
    )


@pytest.mark.slow
def test_modules_of_the_baselines_are_attributes() -> None:
    assert output_of("import tsttc_baselines as b; print(b.pixel_mse.PixelMse.__name__)") == "PixelMse\n"
    with pytest.raises(AttributeError, match="no attribute 'absent'"):
        tsttc_baselines.absent  # type: ignore[attr-defined]  # noqa: B018 -- that is the point
