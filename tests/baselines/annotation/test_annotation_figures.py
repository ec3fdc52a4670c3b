"""The figures of docs/annotation.md show what the annotation computes."""

from baselines.drawing import Dot, Figure, Text
from docs._annotation_figures import choice_figure, consensus_figure


def texts(figure: Figure) -> list[str]:
    return [shape.text for shape in figure.shapes if isinstance(shape, Text)]


def test_the_consensus_has_the_true_velocity_and_least_squares_over_all_has_not() -> None:
    found = texts(consensus_figure())
    assert found[found.index("consensus of 8 frames:") + 1] == "−5.0 m/s, τ = 4.0 s"
    assert found[found.index("least squares over 10:") + 1] != "−5.0 m/s, τ = 4.0 s"


def test_every_choice_by_radar_has_a_dot_while_the_vehicle_brakes() -> None:
    figure = choice_figure()
    assert sum(isinstance(shape, Dot) for shape in figure.shapes) > 10
    assert "chosen; a dot where" in texts(figure)
    assert all(0 <= shape.x <= figure.width for shape in figure.shapes if isinstance(shape, Dot))
