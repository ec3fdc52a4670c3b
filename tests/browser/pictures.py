"""Photographs made small: at most 256 colours, which is plenty for text and hairlines."""

import base64
import struct
import zlib
from typing import Final

import numpy as np
from numpy.typing import NDArray
from playwright.sync_api import Page

MAX_COLOURS: Final = 256
N_EXACT: Final = 24
# The browser that made the picture takes it apart again; it comes back as rows of red, green, blue, alpha.
TAKE_APART: Final = """async (encoded) => {
  const image = await createImageBitmap(await (await fetch("data:image/png;base64," + encoded)).blob());
  const canvas = new OffscreenCanvas(image.width, image.height);
  const context = canvas.getContext("2d");
  context.drawImage(image, 0, 0);
  const bytes = context.getImageData(0, 0, image.width, image.height).data;
  let text = "";
  for (let i = 0; i < bytes.length; i += 32768) text += String.fromCharCode(...bytes.subarray(i, i + 32768));
  return [image.width, image.height, btoa(text)];
}"""


def smaller(png: bytes, *, page: Page) -> bytes:
    """The same picture with a palette. `page` is any page whose policy lets it read data addresses."""
    width, height, encoded = page.evaluate(TAKE_APART, base64.b64encode(png).decode())
    rgba = np.frombuffer(
        base64.b64decode(encoded), dtype="<u4"
    )  # as one number each, of which alpha is the top
    packed, index, counts = np.unique(rgba, return_inverse=True, return_counts=True)
    colours = packed.view(np.uint8).reshape(-1, 4)[:, :3]
    kept = _chosen(colours, counts)
    pixels = _nearest(colours, colours[kept])[index].reshape(height, width)
    return _png(pixels.astype(np.uint8), colours[kept])


def _chosen(colours: NDArray[np.uint8], counts: NDArray[np.intp]) -> NDArray[np.intp]:
    """The most frequent colours, then that of each neighbourhood: greys of letters leave room for marks."""
    by_count = np.argsort(-counts, kind="stable")
    coarse = colours[by_count].astype(np.uint32) >> 4
    _, first = np.unique(coarse @ np.array([256, 16, 1], dtype=np.uint32), return_index=True)
    neighbours = np.sort(first[first >= N_EXACT])
    return by_count[np.concatenate([np.arange(min(N_EXACT, len(by_count))), neighbours])[:MAX_COLOURS]]


def _nearest(colours: NDArray[np.uint8], kept: NDArray[np.uint8]) -> NDArray[np.intp]:
    """For each colour the one that is kept in its stead."""
    palette = kept.astype(np.int32)
    return np.concatenate(
        [
            ((part.astype(np.int32)[:, None, :] - palette) ** 2).sum(axis=2).argmin(axis=1)
            for part in np.array_split(colours, max(1, len(colours) // 4096))
        ]
    )


def _png(pixels: NDArray[np.uint8], palette: NDArray[np.uint8]) -> bytes:
    """An indexed picture: rows without a filter, which suits flat ground best."""
    height, width = pixels.shape
    rows = np.hstack([np.zeros((height, 1), dtype=np.uint8), pixels])
    chunks = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)),
        (b"PLTE", palette.tobytes()),
        (b"IDAT", zlib.compress(rows.tobytes(), 9)),
        (b"IEND", b""),
    )
    body = b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in chunks
    )
    return b"\x89PNG\r\n\x1a\n" + body
