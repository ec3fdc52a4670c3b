"""What a run of a baseline takes over a folder of the size of the test set, with everything that it needs.

`python -m benchmarks.baseline_runs [N …]` measures N sequences each, by default a tenth of the test set and
all of it. The command runs as a researcher runs it, on two processes: it reads the tables, decodes the
frames and writes the file. Frames are 1024×576 JPEGs of about 100 kB, of which five sequences have four, as
in the dataset (206,000 sequences in a million images); their files are links to a few, so disks play no part.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

SIZES = (2_860, 28_600)
N_JOBS = 2
N_IMAGES = 48
SIZE = (1024, 576)
SEQUENCES_PER_RECORDING = 40
SEQUENCES_PER_FRAME = 1.25
START_NS = 1_600_000_000_000_000_000
STEP_NS = 100_000_000


def main(sizes: Sequence[int] = SIZES) -> None:
    """Print one line per figure, `name = value unit`."""
    for n in sizes:
        with tempfile.TemporaryDirectory() as folder:
            measure_run(make_folder(Path(folder), n), n)


def measure_run(folder: Path, n: int) -> None:
    """A run of Pixel MSE; the memory is that of the largest of its processes."""
    out = folder / "predictions.json"
    command = [sys.executable, "-m", "evaluator", "baseline", "run", "pixel-mse", str(folder)]
    began_s = time.perf_counter()
    process = subprocess.Popen(
        [*command, "--out", str(out), "--jobs", str(N_JOBS)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd=Path(__file__).resolve().parents[1],
    )
    _, status, used = os.wait4(process.pid, 0)
    wall_s = time.perf_counter() - began_s
    assert status == 0, status
    n_fallback = sum(json.loads(out.read_bytes())["meta"]["n_fallback"].values())
    processor_s = used.ru_utime + used.ru_stime
    print(f"baseline_runs.{n}_pixel_mse = {wall_s:.1f} s")
    print(f"baseline_runs.{n}_pixel_mse_processor = {processor_s:.1f} s")
    print(f"baseline_runs.{n}_pixel_mse_processor_per_pair = {1000 * processor_s / n:.2f} ms")
    print(f"baseline_runs.{n}_pixel_mse_memory = {used.ru_maxrss / 1024:.0f} MB")
    print(f"baseline_runs.{n}_pixel_mse_fallbacks = {n_fallback}")


def make_folder(folder: Path, n: int) -> Path:
    """A folder of the convention with `n` sequences; reference and target frames alone have an image."""
    rng = np.random.default_rng(20230901)
    images = [folder / "distinct" / f"{number}.jpg" for number in range(N_IMAGES)]
    images[0].parent.mkdir()
    for path in images:
        path.write_bytes(cv2.imencode(".jpg", scenery(rng), [cv2.IMWRITE_JPEG_QUALITY, 92])[1].tobytes())
    manifest, boxes = ["anno_id,bag_stamp,cam_id,ts,track_id"], ["anno_id,frame,x1,y1,x2,y2"]
    for anno_id in range(n):
        bag = f"{anno_id // SEQUENCES_PER_RECORDING:06d}"
        camera = folder / "images" / bag / "cam1"
        camera.mkdir(parents=True, exist_ok=True)
        ts = START_NS + 6 * int(anno_id % SEQUENCES_PER_RECORDING / SEQUENCES_PER_FRAME) * STEP_NS
        manifest.append(f"{anno_id},{bag},1,{ts},{anno_id}")
        for frame in (0, 5):
            link = camera / f"{ts - (5 - frame) * STEP_NS}.jpg"
            if not link.is_symlink():
                link.symlink_to(images[int(rng.integers(N_IMAGES))])
        boxes += box_rows(anno_id, rng)
    (folder / "manifest.csv").write_text("\n".join([*manifest, ""]))
    (folder / "boxes.csv").write_text("\n".join([*boxes, ""]))
    return folder


def box_rows(anno_id: int, rng: np.random.Generator) -> list[str]:
    """Reference and target box of a sequence: widths of 20 to 200 px, log-uniform."""
    width = np.exp(rng.uniform(np.log(20), np.log(200)))
    x, y = rng.uniform([200, 200], [800, 400])
    rows = []
    for frame, scale in ((0, rng.uniform(0.8, 1.2)), (5, 1.0)):
        half = np.array([width, 0.8 * width]) * scale / 2
        edges = [x - half[0], y - half[1], x + half[0], y + half[1]]
        rows.append(f"{anno_id},{frame},{','.join(f'{edge:.2f}' for edge in edges)}")
    return rows


def scenery(rng: np.random.Generator) -> np.ndarray:
    """An image with detail at every size, as photographs have it."""
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(SIZE[0]), np.fft.fftfreq(SIZE[1])))
    channels = []
    for _ in range(3):
        spectrum = np.fft.fft2(rng.standard_normal((SIZE[1], SIZE[0]))) / np.maximum(frequency, 1e-3) ** 1.6
        noise = np.real(np.fft.ifft2(spectrum))
        channels.append(128 + 40 * noise / noise.std())
    return np.clip(np.stack(channels, axis=2), 0, 255).astype(np.uint8)


if __name__ == "__main__":
    main([int(text) for text in sys.argv[1:]] or SIZES)
