"""The paper's baselines, runnable on folders of frames and boxes, and the renderer that makes such folders.

    from tsttc_baselines.pixel_mse import PixelMse
    estimate = PixelMse()(clip, frame_gap=5)

Imports the evaluator, never Django; the evaluator never imports it. OpenCV comes with
`pip install '.[baselines]'`.
"""

import os

# Sequences are spread over processes. Products of small matrices are slower with threads, on a busy machine
# ten times. This takes effect where numpy is not imported yet: in `tsttc` and the processes that it starts.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
