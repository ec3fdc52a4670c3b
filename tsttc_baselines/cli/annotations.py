"""`tsttc baseline annotate`: ground truth from tracks of 3D boxes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from evaluator.cli.failures import echo_json
from evaluator.cli.options import default_option, json_option
from evaluator.cli.reading import TABLE, naming, write_bytes
from tsttc_baselines.cli.options import out_option

if TYPE_CHECKING:
    from tsttc_baselines.annotation.pipeline import Annotation
    from tsttc_baselines.annotation.tracks import Tracks


@click.command(short_help="Create ground truth from tracks of 3D boxes.")
@click.argument("source", metavar="TRACK.csv|FOLDER", type=TABLE)
@out_option("Write the ground truth to this file.", name="--output", metavar="TRUTH.csv")
@default_option(
    "--format",
    "input_format",
    type=click.Choice(("csv", "kitti")),
    default="csv",
    help="A table of tracks, or a folder of KITTI tracking labels.",
)
@click.option(
    "--overlapping",
    is_flag=True,
    help="Every six successive frames are a sequence; the toolkit cuts without overlap.",
)
@default_option(
    "--depth",
    type=click.Choice(("checked", "measured", "consensus")),
    default="checked",
    help="Depth of a frame that disagrees with the line through the frames before it. checked: as measured, "
    "unless it jumped by more than a vehicle can; measured: always as measured; consensus: always on the "
    "line.",
)
@default_option(
    "--tolerance",
    "inlier_m",
    type=click.FloatRange(min=0, min_open=True),
    default=0.15,
    metavar="M",
    help="Metres within which a frame agrees with a velocity.",
)
@click.option(
    "--boxes",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Also write the boxes of the sequences, as boxes.csv of `tsttc baseline run`.",
)
@json_option
def annotate(
    *,
    source: Path,
    output: Path,
    input_format: str,
    overlapping: bool,
    depth: Literal["checked", "measured", "consensus"],
    inlier_m: float,
    boxes: Path | None,
    as_json: bool,
) -> None:
    """Create ground truth from TRACK.csv, a table of 3D boxes, or with --format kitti from a FOLDER.

    Distance is that of the nearest corner of the box; its velocity comes from the past 3, 5 and 10 frames.
    Where these differ, the one nearest to the radar's velocity counts. The file has a column for the choice.

    \b
    Examples:
      tsttc baseline annotate track.csv -o truth.csv
      tsttc baseline annotate label_02/ --format kitti -o truth.csv --overlapping
    """
    if source.is_dir() != (input_format == "kitti"):
        expected = "a folder of labels" if input_format == "kitti" else "a table (folders: --format kitti)"
        kind = "a folder" if source.is_dir() else "a file"
        message = f"{source} is {kind}; --format {input_format} expects {expected}."
        raise click.UsageError(message)
    from tsttc_baselines.annotation import pipeline  # noqa: PLC0415 -- numpy, which --help can do without

    with naming(source):
        tracks = _tracks(source, input_format)
        annotation = pipeline.annotate(
            tracks, cut="overlapping" if overlapping else "toolkit", depth=depth, inlier_m=inlier_m
        )
    write_bytes(output, annotation.text().encode())
    if boxes is not None:
        write_bytes(boxes, _box_table(tracks, annotation).encode())
    if as_json:
        echo_json({"output": str(output), "counts": dict(annotation.counts)})
        return
    click.echo("\n".join(_in_words(annotation, output, has_radar=tracks.has_radar)))


def _tracks(source: Path, input_format: str) -> Tracks:
    from tsttc_baselines.annotation.kitti import read_kitti  # noqa: PLC0415 -- numpy, as above
    from tsttc_baselines.annotation.tracks import read_tracks  # noqa: PLC0415 -- as above

    return read_kitti(source) if input_format == "kitti" else read_tracks(source)


def _box_table(tracks: Tracks, annotation: Annotation) -> str:
    lines = ["anno_id,frame,x1,y1,x2,y2"]
    for anno_id, rows in enumerate(annotation.rows.tolist()):
        lines += [
            f"{anno_id},{frame},{','.join(map(repr, box))}"
            for frame, box in enumerate(tracks.box_px[rows].tolist())
        ]
    return "\n".join([*lines, ""])


def _in_words(annotation: Annotation, output: Path, *, has_radar: bool) -> Iterator[str]:
    counts = annotation.counts
    recordings = len(set(annotation.table.bag_stamp))
    yield f"{output}: {_n(counts['sequences'], 'sequence')} of {_n(recordings, 'recording')}."
    yield f"Read: {_n(counts['observations'], 'observation')} of {_n(counts['tracks'], 'track')}."
    left_out = [
        (counts["short_tracks"], "tracks have fewer than six frames"),
        (counts["truncated"], "observations are truncated"),
        (counts["small_box"], "observations have a box below 15 pixels"),
        (counts["without_box"], "observations have no box; they count for the velocity only"),
        (counts["standing_still"], "sequences have no finite time to contact, because nothing moves"),
        (counts["undefined_error"], "sequences are in contact (−0.1 s to 0 s), where errors are undefined"),
    ]
    lines = [f"  {n:,} {what}" for n, what in left_out if n]
    yield from ["Left out:", *lines] if lines else []
    agree, by_radar, without = (counts[f"choice_{reason}"] for reason in ("agree", "radar", "no-radar"))
    yield f"The velocities of 3, 5 and 10 frames agree in {_n(agree, 'sequence')}."
    yield (
        f"They differ in {by_radar + without:,}: radar decides {by_radar:,}, "
        f"and {without:,} without radar have the velocity of 10 frames."
    )
    if has_radar and counts["without_radar"]:
        yield f"The radar has no velocity for {_n(counts['without_radar'], 'observation')}."


def _n(count: int, noun: str) -> str:
    return f"{count:,} {noun}" if count == 1 else f"{count:,} {noun}s"
