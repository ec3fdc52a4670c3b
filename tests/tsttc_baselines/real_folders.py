"""Real drives as folders of the convention: written into a test's own folder, never kept."""

import csv
from pathlib import Path

FRAME_NS = 100_000_000


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def write_manifest(source: Path, folder: Path) -> None:
    """`manifest.csv` from `truth.csv`."""
    columns = ("anno_id", "bag_stamp", "cam_id", "ts", "track_id")
    rows = [",".join(row[column] for column in columns) for row in rows_of(source / "truth.csv")]
    (folder / "manifest.csv").write_text("\n".join([",".join(columns), *rows, ""]))


def kitti_label_folder(source: Path, labels: Path, folder: Path) -> Path:
    """The drives of kitti-dev without images, all boxes as the label files have them: in all digits."""
    write_manifest(source, folder)
    box_of = {
        (path.stem, int(fields[0]), fields[1]): fields[6:10]
        for path in labels.glob("*.txt")
        for fields in map(str.split, path.read_text().splitlines())
    }
    lines = ["anno_id,frame,x1,y1,x2,y2"]
    for row in rows_of(source / "truth.csv"):
        first = int(row["ts"]) // FRAME_NS - 5
        for frame in range(6):
            box = box_of.get((row["bag_stamp"], first + frame, row["track_id"]))
            if box is not None:
                lines.append(",".join([row["anno_id"], str(frame), *box]))
    (folder / "boxes.csv").write_text("\n".join([*lines, ""]))
    return folder


def kitti_clip_folder(source: Path, folder: Path) -> Path:
    """The clip of 27 frames with boxes in all frames; images are links to where they are."""
    write_manifest(source, folder)
    boxes = [
        ",".join(row[edge] for edge in ("x1", "y1", "x2", "y2")) for row in rows_of(source / "depth.csv")
    ]
    lines = ["anno_id,frame,x1,y1,x2,y2"]
    for row in rows_of(source / "boxes.csv"):
        first = int(row["target_frame"]) - 5
        lines += [f"{row['anno_id']},{frame},{boxes[first + frame]}" for frame in range(6)]
    (folder / "boxes.csv").write_text("\n".join([*lines, ""]))
    for row in rows_of(source / "truth.csv"):
        camera = folder / "images" / row["bag_stamp"] / f"cam{row['cam_id']}"
        camera.mkdir(parents=True, exist_ok=True)
        for image in (source / "frames").glob("*.png"):
            link = camera / f"{int(image.stem) * FRAME_NS}.png"
            if not link.exists():
                link.symlink_to(image)
    return folder
