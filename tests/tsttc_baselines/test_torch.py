"""`BoxCrops`: pairs as a network takes them, with the true scale ratio whatever augmentation did."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from evaluator import Rejected, fps_of_gap, read_truth, ttc_to_scale_ratio
from tests.evaluator.worlds import EXAMPLES
from tests.tsttc_baselines.made_folders import image_path, made_folder, write_boxes
from tsttc_baselines.clips import Clip
from tsttc_baselines.torch import BoxCrops, crops_of_clip

pytestmark = pytest.mark.torch

FOLDER = EXAMPLES / "baseline"


def test_batches_have_the_rows_and_scale_ratios_of_the_ground_truth() -> None:
    torch.manual_seed(0)
    batches = list(DataLoader(BoxCrops(FOLDER, size_px=32), batch_size=5, shuffle=True, num_workers=2))
    assert [tuple(batch["crops"].shape) for batch in batches] == [(5, 2, 3, 32, 32)] * 2 + [(2, 2, 3, 32, 32)]
    rows = torch.cat([batch["row"] for batch in batches])
    assert sorted(rows.tolist()) == list(range(12))
    assert rows.tolist() != list(range(12))
    expected = ttc_to_scale_ratio(read_truth(FOLDER / "truth.csv").ttc_s, fps_hz=fps_of_gap(5))
    ratios = torch.cat([batch["scale_ratio"] for batch in batches])
    np.testing.assert_allclose(ratios, expected[rows], rtol=1e-6)
    box_ratios = torch.cat([batch["box_ratio"] for batch in batches])
    assert ((box_ratios / ratios).log().abs() < 0.1).all(), "boxes say about the same"
    crops = torch.cat([batch["crops"] for batch in batches])
    assert 0 <= crops.min() < 0.2
    assert 0.8 < crops.max() <= 1
    assert torch.cat([batch["usable"] for batch in batches]).all()


def test_crops_show_their_own_boxes_red_first() -> None:
    frames = [np.zeros((60, 80, 3), dtype=np.uint8) for _ in range(6)]
    boxes = np.full((6, 4), np.nan)
    for frame, box in ((0, (10, 10, 30, 30)), (5, (20, 15, 60, 55))):
        boxes[frame] = box
        cv2.rectangle(frames[frame], (box[0], box[1]), (box[2] - 1, box[3] - 1), (0, 0, 255), -1)
    crops, box_ratio = crops_of_clip(Clip.from_frames(frames, boxes=boxes), frame_gap=5, size_px=24)
    assert box_ratio == 0.5
    assert crops.shape == (2, 3, 24, 24)
    assert (crops[:, 0, 3:-3, 3:-3] == 1).all(), "the box of both frames, of 20 of 24 pixels"
    assert crops[:, 1:].max() == 0
    assert crops[:, 0, 0].max() < 0.6


def test_augmented_pairs_have_the_scale_ratio_that_they_show() -> None:
    """The frames show a square of a known size; colour, mirroring, order and size may change it."""
    frame_0, frame_5 = (np.full((200, 240, 3), 60, dtype=np.uint8) for _ in range(2))
    boxes = np.array([80.0, 60, 160, 140]), np.array([70.0, 50, 170, 150])
    for frame, box in zip((frame_0, frame_5), boxes, strict=True):
        x1, y1, x2, y2 = box.astype(int).tolist()
        frame[y1:y2, x1:x2] = 200

    class Squares:
        truth = read_truth(FOLDER / "truth.csv").subset([0])
        scale_ratios = np.array([0.8])

        def clip(self, _row: int) -> Clip:
            stack = np.full((6, 4), np.nan)
            stack[0], stack[5] = boxes
            return Clip.from_frames([frame_0, *[frame_5] * 5], boxes=stack)

    torch.manual_seed(1)
    data = BoxCrops(Squares(), augment=True, context=2.0)
    items = [data[0] for _ in range(60)]
    seen = [float(item["box_ratio"] * (side(item["crops"][0]) / side(item["crops"][1]))) for item in items]
    ratios = [float(item["scale_ratio"]) for item in items]
    np.testing.assert_allclose(seen, ratios, rtol=0.05)
    assert min(ratios) < 0.77
    assert max(ratios) > 1.2, "some are swapped, some resized"
    assert len({float(item["box_ratio"]) for item in items}) > 50, "boxes move"
    torch.manual_seed(1)
    assert torch.equal(data[0]["crops"], items[0]["crops"]), "torch's seed decides"


def side(crop: torch.Tensor) -> float:
    """The side of the bright square, as a part of the crop's."""
    grey = crop.mean(0)
    return float(((grey - grey.min()) / (grey.max() - grey.min())).mean().sqrt())


def test_a_sequence_that_cannot_be_used_says_so_and_has_the_ratio_of_its_boxes(tmp_path: Path) -> None:
    folder = made_folder(tmp_path)
    lines = (folder / "manifest.csv").read_text().splitlines()
    rows = [f"{lines[0]},ttc", *(f"{line},4.0" for line in lines[1:]), ""]
    (folder / "truth.csv").write_text("\n".join(rows))
    image_path(folder, 0, 5).unlink()
    write_boxes(folder, changes={(1, 0): ()})
    items = list(BoxCrops(folder))
    assert [bool(item["usable"]) for item in items] == [False, False, True]
    assert 0.7 < items[0]["box_ratio"] < 0.9
    assert items[1]["box_ratio"] == 1
    assert items[0]["crops"].max() == 0
    (folder / "truth.csv").unlink()
    with pytest.raises(Rejected, match=r"neither truth\.csv nor annotation files"):
        BoxCrops(folder)
