"""The paper's tables as data."""

import pytest

from evaluator.papers.tables import published_tables


def test_every_value_has_a_column_with_a_unit() -> None:
    for table in published_tables().tables:
        assert all(len(row.values) == len(table.columns) for row in table.rows), table.name
        if table.is_result:
            assert set(table.columns) == set(table.units), table.name


def test_an_ablation_answers_by_method_and_setting() -> None:
    gaps = published_tables().table("ablation-frame-gap")
    mids = [gaps.value(method="pixel-mse", setting=gap, column="mid") for gap in range(1, 6)]
    assert mids == [102.1, 61.2, 46.4, 41.2, 41.0]


def test_what_the_paper_did_not_try_has_no_value() -> None:
    bins = published_tables().table("ablation-scale-bins-pixel-mse")
    assert bins.value(method="pixel-mse", setting=25, column="mid") is None
    with pytest.raises(KeyError):
        bins.value(method="pixel-mse", setting=50, column="mid_crucial")


def test_an_ablation_of_one_split_does_not_answer_for_another() -> None:
    blur = published_tables().table("ablation-plate-blur")
    mids = [blur.value(method="pixel-mse", setting=True, column="mid", split=s) for s in ("val", "test")]
    assert mids == [41.0, 40.3]
