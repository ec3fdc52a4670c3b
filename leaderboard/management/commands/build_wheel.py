"""`manage.py build_wheel`: the wheel and the archive of examples that the site serves at `/dist/`."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Final
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from django.conf import settings
from django.core.management.base import BaseCommand, CommandError

from leaderboard.web.docs.wheels import EXAMPLES

PACKAGES: Final = ("evaluator", "tsttc_baselines")
FILES: Final = ("pyproject.toml", "PACKAGE.md", "LICENSE")
_BUILD: Final = "import sys; from setuptools import build_meta; build_meta.build_wheel(sys.argv[1])"
# The time of every file in the wheel, the first that a zip can say: the same sources make the same bytes.
_EPOCH_S: Final = "315532800"


class Command(BaseCommand):
    help = "Build the wheel of the evaluator that visitors install from /dist/."

    def handle(self, *args: Any, **options: Any) -> None:
        self.stdout.write(f"Built {build().name}; the site serves it at /dist/.")


def build() -> Path:
    """Build the wheel into `settings.DIST_DIR`. Raises `CommandError` with the output of setuptools."""
    root, out = Path(settings.BASE_DIR), Path(settings.DIST_DIR)
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as directory:
        # From a copy: setuptools writes beside its sources, and takes what former builds left there.
        source, made = Path(directory, "source"), Path(directory, "made")
        made.mkdir()
        for name in PACKAGES:
            shutil.copytree(root / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
        for name in FILES:
            shutil.copy(root / name, source)
        done = subprocess.run(  # noqa: S603 - our own interpreter on our own sources
            [sys.executable, "-c", _BUILD, str(made)],
            cwd=source,
            env=os.environ | {"SOURCE_DATE_EPOCH": _EPOCH_S},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise CommandError(f"setuptools could not build the wheel:\n{done.stderr.strip()[-2000:]}")
        (wheel,) = made.glob("*.whl")
        _put(_pack_examples(root / "examples", made / EXAMPLES), out=out)
        return _put(wheel, out=out)


def _put(path: Path, *, out: Path) -> Path:
    # Beside its place first: nobody is served one that is half there.
    waiting = out / f".{path.name}"
    shutil.copy(path, waiting)
    waiting.chmod(0o644)
    return waiting.replace(out / path.name)


def _pack_examples(folder: Path, path: Path) -> Path:
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        for each in sorted(folder.rglob("*")):
            if each.is_file() and "__pycache__" not in each.parts:
                entry = ZipInfo(
                    f"tsttc-examples/{each.relative_to(folder).as_posix()}"
                )  # of 1980, as the wheel
                archive.writestr(entry, each.read_bytes(), ZIP_DEFLATED)
    return path


def is_built() -> bool:
    built_s = max((path.stat().st_mtime for path in Path(settings.DIST_DIR).glob("tsttc-*.whl")), default=0.0)
    root = Path(settings.BASE_DIR)
    sources = [root / "pyproject.toml", *(path for name in PACKAGES for path in (root / name).rglob("*.py"))]
    return all(path.stat().st_mtime <= built_s for path in sources)
