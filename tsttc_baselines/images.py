"""Images: read, checked, decoded on access, and cached."""

# Several objects share a frame, and sequences come in order of time: most frames are decoded once.

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from evaluator.problems import Problem
from tsttc_baselines.clips import Image
from tsttc_baselines.estimates import SequenceFault

MAX_CACHED_BYTES: Final = 64 * 2**20
"""A hundred grey images of 1024×576."""

_MAX_SIZES: Final = 4096


class ImageCache:
    """Keeps the last decoded images in memory, up to `max_bytes` (64 MiB); make one for each process."""

    def __init__(self, *, max_bytes: int = MAX_CACHED_BYTES) -> None:
        self._max_bytes = max_bytes
        self._n_bytes = 0
        self._images: OrderedDict[tuple[Path, bool], Image] = OrderedDict()
        self._sizes: OrderedDict[Path, tuple[int, int]] = OrderedDict()

    def image(self, path: Path, *, colour: bool, where: str) -> Image:
        """Return the image of a file, read-only. Raises `SequenceFault`, whose message names `where`."""
        key = (path, colour)
        cached = self._images.get(key)
        if cached is not None:
            self._images.move_to_end(key)
            return cached
        image = decode(path, colour=colour, where=where)
        image.setflags(write=False)
        self._keep(key, image)
        return image

    def size(self, path: Path, *, where: str) -> tuple[int, int]:
        """Return the width and height of an image in pixels."""
        if path not in self._sizes:
            self.image(path, colour=False, where=where)
        return self._sizes[path]

    def _keep(self, key: tuple[Path, bool], image: Image) -> None:
        self._images[key] = image
        self._n_bytes += image.nbytes
        while self._n_bytes > self._max_bytes and len(self._images) > 1:
            _, dropped = self._images.popitem(last=False)
            self._n_bytes -= dropped.nbytes
        height_px, width_px = image.shape[:2]
        self._sizes[key[0]] = (width_px, height_px)
        if len(self._sizes) > _MAX_SIZES:
            self._sizes.popitem(last=False)


def decode(path: Path, *, colour: bool, where: str) -> Image:
    """Decode an image, (height, width) grey or (height, width, 3) blue first; raises `SequenceFault`."""
    try:
        data = path.read_bytes()
    except OSError as error:
        message = f"The image cannot be read: {error.strerror}; expected a JPEG or PNG file."
        raise SequenceFault("image cannot be read", Problem("bad-frame", message, where)) from None
    fault = _cut_off(data)
    image = None if fault else _decoded(data, colour=colour)
    if image is None:
        message = (
            f"The file {fault or 'is not an image that OpenCV decodes'}; expected a whole JPEG or PNG image."
        )
        raise SequenceFault("image cannot be decoded", Problem("bad-frame", message, where))
    return image


def _decoded(data: bytes, *, colour: bool) -> Image | None:
    flags = cv2.IMREAD_COLOR if colour else cv2.IMREAD_GRAYSCALE
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
    except cv2.error:  # such as an image of more pixels than OpenCV takes
        return None
    return None if image is None else np.asarray(image, dtype=np.uint8)


def _cut_off(data: bytes) -> str | None:
    """Explain what an image file lacks, else None."""
    # A decoder would fill the rest with grey. The marks cannot be in a JPEG's pixels, and a thumbnail
    # precedes them.
    if not data:
        return "is empty"
    is_whole = data.endswith(b"\xff\xd9")  # nearly always; what follows searches all bytes
    if data.startswith(b"\xff\xd8") and not is_whole and data.rfind(b"\xff\xd9") < data.rfind(b"\xff\xda"):
        return f"ends after {len(data):,} bytes inside a JPEG image"
    if data.startswith(b"\x89PNG") and data.rfind(b"IEND") < 0:
        return f"ends after {len(data):,} bytes inside a PNG image"
    return None
