"""Draw the figures of docs/baselines.md from sequences of examples/baseline: `python -m docs._figures`."""

from pathlib import Path

from baselines.drawing import Figure
from baselines.figures import search_figure, task_figure
from baselines.folders import read_folder
from baselines.images import ImageCache
from baselines.pixel_mse import PixelMse
from evaluator import read_truth

REPOSITORY = Path(__file__).resolve().parents[1]
FOLDER = REPOSITORY / "examples" / "baseline"
FIGURES = REPOSITORY / "docs" / "figures"


def figures() -> dict[Path, Figure]:
    """Each figure with its file."""
    folder, cache = read_folder(FOLDER), ImageCache()
    near, far = (folder.clip(row, cache=cache) for row in (0, 1))
    near_s, far_s = read_truth(FOLDER / "truth.csv").ttc_s[:2].tolist()
    frames = [near.colour(frame) for frame in range(6)]
    return {
        FIGURES / "task.svg": task_figure(frames, boxes=near.boxes, ttc_s=near_s),
        **{
            FIGURES / f"baseline-{name}.svg": search_figure(
                clip, estimator=PixelMse(), frame_gap=5, true_ttc_s=ttc_s
            )
            for name, clip, ttc_s in (("near", near, near_s), ("far", far, far_s))
        },
    }


if __name__ == "__main__":
    for path, figure in figures().items():
        path.write_text(figure.svg(), encoding="utf-8")
