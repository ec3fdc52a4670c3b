"""What everybody would see of a method, ready to be drawn, and what is said of one in words."""

from dataclasses import dataclass
from uuid import UUID

from leaderboard.entries import Details, Profile
from leaderboard.models import BoxSource, Cameras, Method, Visibility
from leaderboard.visibility import Preview, Sight
from leaderboard.web.result_tables import ResultGroup, result_groups


@dataclass(frozen=True)
class SightTable:
    """The row of one split's board, and its ten numbers."""

    sight: Sight
    groups: tuple[ResultGroup, ...]


@dataclass(frozen=True)
class PreviewTable:
    """Everything that the preview's template places."""

    visibility: str
    label: str
    profile: Profile
    details: tuple[tuple[str, str], ...]
    sights: tuple[SightTable, ...]


def preview_table(preview: Preview | None) -> PreviewTable | None:
    """The preview, ready to be drawn."""
    if preview is None:
        return None
    return PreviewTable(
        visibility=preview.visibility,
        label=Visibility(preview.visibility).label,
        profile=preview.profile,
        details=detail_words(preview.profile.details),
        sights=tuple(
            SightTable(
                sight=sight,
                groups=result_groups(
                    sight.entry.scores,
                    {"overall": sight.edition.ground_truth.n_sequences, **sight.edition.ground_truth.counts},
                    intervals=sight.entry.intervals,
                    decimals=sight.entry.decimals,
                    best=sight.entry.best,
                    second=sight.entry.second,
                ),
            )
            for sight in preview.sights
        ),
    )


def detail_words(details: Details) -> tuple[tuple[str, str], ...]:
    """What is said of a method, each with its name; what is not said is left out.

    >>> detail_words(Details(n_frames=6, uses_nerf=False, latency_ms=41.5, hardware="one GPU"))
    (('Frames used', '6'), ('NeRF data', 'no'), ('Latency', '41.5 ms on one GPU'))
    """
    yes_no = {True: "yes", False: "no", None: ""}
    measured = f" on {details.hardware}" if details.hardware else ""
    said = (
        ("Frames used", str(details.n_frames or "")),
        ("Cameras", str(Cameras(details.cameras).label) if details.cameras else ""),
        ("Box of the object", str(BoxSource(details.box_source).label) if details.box_source else ""),
        ("NeRF data", yes_no[details.uses_nerf]),
        ("Extra data", yes_no[details.uses_extra_data]),
        ("Pretraining", details.pretraining),
        ("Parameters", f"{details.n_parameters:,}" if details.n_parameters else ""),
        ("Latency", f"{details.latency_ms:g} ms{measured}" if details.latency_ms is not None else ""),
    )
    return tuple((name, text) for name, text in said if text)


def shown_sentence(method_id: UUID) -> str:
    """What has just become of a method."""
    method = Method.objects.get(pk=method_id)
    if method.visibility == Visibility.PUBLIC:
        return f"{method.name} is public now."
    until = f", until {method.reveal_at:%Y-%m-%d %H:%M} UTC" if method.reveal_at else ""
    return f"Everybody sees {method.name} as {method.pseudonym} now{until}."
