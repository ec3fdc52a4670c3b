"""What a researcher or a CI job waits for before anything happens: installing the command, and starting it.

The wheel is built from the checkout and installed by pip into an environment that had nothing, with an empty
cache and with a warm one; `tsttc --help` is started from there.
"""

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path
from typing import NamedTuple

REPOSITORY = Path(__file__).resolve().parents[1]
N_STARTS = 20
QUIET = ("-qq", "--disable-pip-version-check")  # errors alone


class Taken(NamedTuple):
    """What a command took: of a clock, and of the processor, which neighbours change less."""

    clock_s: float
    processor_s: float


def timed(*command: object, **environment: str) -> Taken:
    """Run a command; it has to succeed."""
    begun_s, before = time.perf_counter(), os.times()
    subprocess.run(
        list(map(str, command)), check=True, stdout=subprocess.DEVNULL, env=os.environ | environment
    )
    after = os.times()
    processor_s = sum(after[i] - before[i] for i in (2, 3))  # of children, user and system
    return Taken(time.perf_counter() - begun_s, processor_s)


def built_wheel(folder: Path) -> Path:
    """The wheel, from a copy so that the checkout stays clean."""
    source = folder / "source"
    source.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(REPOSITORY / name, source)
    shutil.copytree(
        REPOSITORY / "evaluator", source / "evaluator", ignore=shutil.ignore_patterns("__pycache__")
    )
    timed(sys.executable, "-m", "pip", "wheel", *QUIET, "--no-deps", "--wheel-dir", folder, source)
    (wheel,) = folder.glob("tsttc-*.whl")
    return wheel


def installed(folder: Path, wheel: Path, *, name: str, cache: Path) -> Taken:
    """What pip takes in a new environment of that name."""
    venv.create(folder / name, with_pip=True, symlinks=True)
    python = folder / name / "bin" / "python"
    return timed(python, "-m", "pip", "install", *QUIET, wheel, PIP_CACHE_DIR=str(cache))


def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        names = ("empty", "warm")
        try:
            wheel = built_wheel(folder)
            found = {name: installed(folder, wheel, name=name, cache=folder / "cache") for name in names}
        except subprocess.CalledProcessError as failed:
            # Without a registry there is nothing to install from; pip has said what it lacks.
            print(f"cli is not measured: pip ended with {failed.returncode}")
            return
        for name, taken in found.items():
            print(f"cli.install_{name}_cache = {taken.clock_s:.1f} s")
            print(f"cli.install_{name}_cache_processor = {taken.processor_s:.1f} s")
        program = folder / "warm" / "bin" / "tsttc"
        n_bytes = sum(path.stat().st_size for path in folder.glob("warm/lib/*/site-packages/**/*.*"))
        print(f"cli.installed = {n_bytes / 1e6:.0f} MB")
        for arguments in (["--help"], ["submit", "--help"], ["--version"]):
            timed(program, *arguments)  # compiles what is imported
            starts = [timed(program, *arguments) for _ in range(N_STARTS)]
            words = "_".join(arguments).replace("-", "")
            print(f"cli.start_{words} = {statistics.median(start.clock_s for start in starts):.3f} s")
            print(f"cli.start_{words}_slowest = {max(start.clock_s for start in starts):.3f} s")
            processor_s = statistics.median(start.processor_s for start in starts)
            print(f"cli.start_{words}_processor = {processor_s:.3f} s")
