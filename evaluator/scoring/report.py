"""The report on one set of predictions."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING

from evaluator.counting import counted
from evaluator.metrics.protocol import OVERALL, metric_of, range_of, score_name
from evaluator.metrics.scale import Floats
from evaluator.scoring.breakdown import GroupName, group_name, groups_of, scores_of
from evaluator.scoring.results import Details, GroupScores, RangeScore, RecordingSums, format_rounded

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Literal

    import pandas as pd
    from matplotlib.figure import Figure

    from evaluator.units import UnitKind

    PlotKind = Literal["error", "scatter", "distribution"]


@dataclass(frozen=True, slots=True)
class Report:
    """Means per TTC range, counts, and the number of predictions truncated to each boundary.

    `scores` follow the protocol's `range_names`: overall, crucial, …. `sequences` (by metric, the errors of
    every sequence in the manifest's order), `details` and `bags` are there on request only, and never part of
    the JSON. `by`, `frame` and `plot` need `keep_sequences=True`.
    """

    # For a hidden split, `sequences`, `details` and `bags` never leave the worker.

    protocol: str
    truth_digest: str
    predictions_digest: str
    n_sequences: int
    n_out_of_range: int
    truncated: Mapping[str, int]
    scores: Mapping[str, RangeScore]
    sequences: Mapping[str, Floats] | None = field(default=None, repr=False)
    bags: RecordingSums | None = field(default=None, repr=False)
    details: Details | None = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        overall = self.scores[OVERALL].means
        means = ", ".join(
            f"{metric_of(name).symbol} {format_rounded(value)}" for name, value in overall.items()
        )
        return f"Report({self.protocol}, {counted(self.n_sequences, 'sequence')}, {means})"

    def __str__(self) -> str:
        header, *rows = self._rows()
        widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
        lines = [
            "  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])])
            for row in (header, *rows)
        ]
        return "\n".join([*lines, f"{counted(self.n_sequences, 'sequence')}, protocol {self.protocol}"])

    def _repr_html_(self) -> str:
        header, *rows = ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in self._rows()]
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        head = f"<tr>{header.replace('td>', 'th>')}</tr>"
        words = escape(f"{counted(self.n_sequences, 'sequence')}, protocol {self.protocol}")
        return f"<table><thead>{head}</thead><tbody>{body}</tbody></table><p>{words}</p>"

    def _rows(self) -> list[list[str]]:
        metrics = list(self.scores[OVERALL].means)
        rows = [["TTC range", *(metric_of(name).heading for name in metrics), "count"]]
        for name, score in self.scores.items():
            ttc_range = range_of(score_name(metrics[0], name))
            title = f"{name} {ttc_range.seconds}" if ttc_range else name
            means = [format_rounded(score.means[metric]) for metric in metrics]
            rows.append([title, *means, f"{score.count:,}"])
        return rows

    # --- a closer look ------------------------------------------------------------------------------------

    def breakdown(
        self, by: GroupName, *, with_intervals: bool = False, unit: UnitKind | None = None
    ) -> list[GroupScores]:
        """Score each group: `by` is recording, camera, range, occlusion, lane or box-size (or box_size).

        `unit` is as in `confidence_intervals`. Raises `ValueError` for another `by`, or if the truth or
        report lacks the data, and `TypeError` for what is no name of a group.
        """
        by = group_name(by)
        details = self.require_details()
        return scores_of(
            details,
            groups=groups_of(details, by=by),
            # A group that is a TTC range is not cut into ranges once more.
            has_ranges=by != "range",
            # One recording has no interval, however many sequences it has.
            with_intervals=with_intervals and by != "recording",
            unit=unit,
        )

    def by(
        self, group: GroupName, *, with_intervals: bool = False, unit: UnitKind | None = None
    ) -> pd.DataFrame:
        """Return `breakdown` as a frame by group: `n_sequences`, `n_recordings`, scores. Needs pandas.

        With intervals, each score has two more columns, such as `mid_low` and `mid_high`.
        """
        group = group_name(group)
        import pandas as pd  # noqa: PLC0415 -- of an extra

        rows = [
            {
                group: row.group,
                "n_sequences": row.n_sequences,
                "n_recordings": row.n_recordings,
                **_with_ends(row, with_intervals=with_intervals),
            }
            for row in self.breakdown(group, with_intervals=with_intervals, unit=unit)
        ]
        return pd.DataFrame(rows).set_index(group)

    def records(self) -> dict[str, list[object]]:
        """Return keys, times (seconds), errors and object annotations as columns, in the manifest's order.

        Raises `ValueError` for a report without sequences.
        """
        details = self.require_details()
        table = details.truth.to_table()
        objects = dict[str, list[object]](occ_ratio=list(table.occ_ratio), same_lane=list(table.same_lane))
        box_height = details.truth.objects.box_height
        return {
            "anno_id": list(table.anno_id),
            "bag_stamp": list(table.bag_stamp),
            "cam_id": list(table.cam_id),
            "ts": list(table.ts_ns),
            "track_id": list(table.track_id),
            "ttc_s": list(table.ttc_s),
            "predicted_ttc_s": details.predicted_ttc_s.tolist(),
            **{name: values.tolist() for name, values in details.errors.items()},
            **{name: values for name, values in objects.items() if values},
            **({} if box_height is None else {"box_height": box_height.tolist()}),
        }

    def frame(self) -> pd.DataFrame:
        """Return one row per sequence with the columns of `records`, indexed by anno_id. Needs pandas."""
        import pandas as pd  # noqa: PLC0415 -- of an extra

        return pd.DataFrame(self.records()).set_index("anno_id")

    def plot(
        self, kind: PlotKind = "error", *, path: str | Path | None = None, name: str = "", **others: Report
    ) -> Figure:
        """Draw `kind`: `error` (by true TTC, with a band), `scatter` or `distribution`. Needs matplotlib.

        `path` (.svg, .pdf, .png) also saves the figure. `name` and the keywords of further reports form the
        legend.
        """
        from evaluator.scoring import plots  # noqa: PLC0415 -- matplotlib is of an extra

        reports = {name or "predictions": self, **others}
        return plots.draw(kind, {key: report.require_details() for key, report in reports.items()}, path=path)

    def require_details(self) -> Details:
        """Return the details; raises `ValueError` that says how to get them."""
        if self.details is None:
            raise ValueError(
                "The report has no errors of single sequences; call evaluate(…, keep_sequences=True)."
            )
        return self.details

    def as_dict(self) -> dict[str, object]:
        """Return the report as plain data, in the shape of `tsttc score --json`."""
        return {
            "protocol": self.protocol,
            "truth_digest": self.truth_digest,
            "predictions_digest": self.predictions_digest,
            "n_sequences": self.n_sequences,
            "n_out_of_range": self.n_out_of_range,
            "truncated": dict(self.truncated),
            "scores": {name: score.as_dict() for name, score in self.scores.items()},
        }

    def to_json(self) -> str:
        """Return `as_dict()` as JSON, every float64 at full precision."""
        return json.dumps(self.as_dict(), allow_nan=False)

    def flat(self) -> dict[str, float | None]:
        """Return the numbers by the protocol's `score_names`, in that order."""
        return {
            score_name(metric, range_name): score.means[metric]
            for metric in self.scores[OVERALL].means
            for range_name, score in self.scores.items()
        }


def _with_ends(row: GroupScores, *, with_intervals: bool) -> dict[str, float | None]:
    columns: dict[str, float | None] = {}
    for name, value in row.scores.items():
        columns[name] = value
        if with_intervals:
            columns[f"{name}_low"], columns[f"{name}_high"] = row.intervals[name] or (None, None)
    return columns
