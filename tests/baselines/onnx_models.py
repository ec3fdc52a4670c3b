"""Two small ONNX models with the inputs and outputs of NanoTrack, written byte by byte.

Its real weights are not at hand. These see nothing: their answer is the same everywhere, a box of a fixed
size about each place, so that what a tracker makes of them is known.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

FLOAT, INTS = 1, 7
SEARCHED_PX, STRIDE_PX, SCORES = 255, 16, 16
UNCHANGED_PX = 31.75
"""From the middle of NanoTrack's template, twice as large as the object, to the object's edge: 127 / 4."""


def write_models(folder: Path, *, edge_px: float) -> tuple[Path, Path]:
    """Backbone and head of a tracker that sees an object `edge_px` from its middle to each edge."""
    backbone, head = folder / "backbone.onnx", folder / "head.onnx"
    window = SEARCHED_PX - STRIDE_PX * (SCORES - 1)
    mean = np.full((1, 3, window, window), 1 / (3 * window**2))
    backbone.write_bytes(
        model(
            nodes=[
                node("Conv", ["input", "mean"], "output", kernel_shape=[window] * 2, strides=[STRIDE_PX] * 2)
            ],
            weights=[tensor("mean", mean)],
            inputs=[value("input", (1, 3, SEARCHED_PX, SEARCHED_PX))],
            outputs=[value("output", (1, 1, SCORES, SCORES))],
        )
    )
    n_template = (127 - window) // STRIDE_PX + 1
    head.write_bytes(
        model(
            nodes=[
                node("GlobalAveragePool", ["input1"], "template"),
                node("Mul", ["input2", "template"], "both"),
                node("Conv", ["both", "none_2", "scores"], "output1", kernel_shape=[1, 1]),
                node("Conv", ["both", "none_4", "edges"], "output2", kernel_shape=[1, 1]),
            ],
            weights=[
                tensor("none_2", np.zeros((2, 1, 1, 1))),
                tensor("scores", np.array([0.0, 4.0])),
                tensor("none_4", np.zeros((4, 1, 1, 1))),
                tensor("edges", np.full(4, edge_px)),
            ],
            inputs=[
                value("input1", (1, 1, n_template, n_template)),
                value("input2", (1, 1, SCORES, SCORES)),
            ],
            outputs=[value("output1", (1, 2, SCORES, SCORES)), value("output2", (1, 4, SCORES, SCORES))],
        )
    )
    return backbone, head


# --- the messages of onnx.proto, as far as they are needed --------------------------------------------------


def model(
    *, nodes: Sequence[bytes], weights: Sequence[bytes], inputs: Sequence[bytes], outputs: Sequence[bytes]
) -> bytes:
    """ModelProto: version 8 of the format, operators of version 13."""
    graph = b"".join(
        [
            *(message(1, each) for each in nodes),
            message(2, b"graph"),
            *(message(5, each) for each in weights),
            *(message(11, each) for each in inputs),
            *(message(12, each) for each in outputs),
        ]
    )
    return number(1, 8) + message(7, graph) + message(8, message(1, b"") + number(2, 13))


def node(operator: str, inputs: Sequence[str], output: str, **attributes: Sequence[int]) -> bytes:
    """NodeProto."""
    return b"".join(
        [
            *(message(1, name.encode()) for name in inputs),
            message(2, output.encode()),
            message(3, output.encode()),
            message(4, operator.encode()),
            *(
                message(
                    5, message(1, name.encode()) + b"".join(number(8, n) for n in ints) + number(20, INTS)
                )
                for name, ints in attributes.items()
            ),
        ]
    )


def tensor(name: str, values: np.ndarray) -> bytes:
    """TensorProto of float32."""
    dims = b"".join(number(1, n) for n in values.shape)
    return dims + number(2, FLOAT) + message(8, name.encode()) + message(9, values.astype("<f4").tobytes())


def value(name: str, shape: Sequence[int]) -> bytes:
    """ValueInfoProto of a float32 tensor."""
    dims = b"".join(message(1, number(1, n)) for n in shape)
    return message(1, name.encode()) + message(2, message(1, number(1, FLOAT) + message(2, dims)))


def message(field: int, data: bytes) -> bytes:
    return varint(field << 3 | 2) + varint(len(data)) + data


def number(field: int, n: int) -> bytes:
    return varint(field << 3) + varint(n)


def varint(n: int) -> bytes:
    more = bytearray()
    while n > 0x7F:
        more.append(n & 0x7F | 0x80)
        n >>= 7
    return bytes([*more, n])
