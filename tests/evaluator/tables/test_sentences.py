"""What a difference means, in words: both ends of its interval, a p that nothing rounds to 0.05."""

import re

import pytest

from evaluator.scoring.significance import Difference
from evaluator.tables.sentences import others, sentence, without_interval

FAR = Difference(-4.1, -5.3, -2.9, 0.0003)


def sentence_of(difference: Difference, *, name: str = "mid", decimals: int = 2) -> str:
    return sentence("A", "B", name=name, difference=difference, decimals=decimals)


@pytest.mark.parametrize(
    ("difference", "amount", "ends"),
    [
        (FAR, "4.1 lower", "2.9 to 5.3 lower"),
        (Difference(13.27, 2.0, 25.0, 0.0123), "13 higher", "2 to 25 higher"),
        (Difference(0.04, 0.01, 0.07, 0.03), "0.04 higher", "0.01 to 0.07 higher"),
        # Fewer digits would make an end 0, which it is not: 0 is outside of what is significant.
        (Difference(-13.0, -25.0, -0.4, 0.0496), "13.0 lower", "0.4 to 25.0 lower"),
        (Difference(-1.5, -2.96, -0.04, 0.0496), "1.50 lower", "0.04 to 2.96 lower"),
        # Full digits, as of files on one's own machine: an end keeps its side of 0.
        (Difference(-1.5, -2.9612, -0.0004, 0.0496), "1.50 lower", "0.01 to 2.96 lower"),
    ],
)
def test_a_significant_difference_has_both_ends_of_its_interval(
    difference: Difference, amount: str, ends: str
) -> None:
    assert sentence_of(difference) == (
        f"The MiD of A is {amount} than that of B (95% confidence interval: {ends}; p = {difference.p:.4f})."
    )


@pytest.mark.parametrize(
    ("difference", "words"),
    [
        (
            Difference(-0.1, -0.2, 0.0, None, 0.001),
            "0.1 lower than that of B "
            "(95% confidence interval: 0.0 to 0.2 lower, rounded outwards; p < 0.001).",
        ),
        (
            Difference(3.6, 0.0, 7.5, None, 0.05),
            "3.6 higher than that of B "
            "(95% confidence interval: 0.0 to 7.5 higher, rounded outwards; p < 0.05).",
        ),
        (
            Difference(13.0, 0.0, 26.0, None, 0.05),
            "13 higher than that of B (95% confidence interval: 0 to 26 higher, rounded outwards; p < 0.05).",
        ),
    ],
)
def test_an_interval_of_a_hidden_split_that_ends_at_0_says_why_and_p_judges(
    difference: Difference, words: str
) -> None:
    assert difference.is_significant
    assert sentence_of(difference, decimals=1) == f"The MiD of A is {words}"


@pytest.mark.parametrize(
    ("difference", "ends", "detectable"),
    [
        (Difference(-2.0, -2.5, 0.3, 0.0812), "0.3 higher to 2.5 lower", "2.0"),
        (Difference(1.1, -0.3, 2.5, 0.12), "0.3 lower to 2.5 higher", "2.0"),
        (Difference(-1.25, -2.5, 0.0, 0.05), "0.0 to 2.5 lower", "1.8"),
    ],
)
def test_an_undecided_difference_says_what_the_test_detects(
    difference: Difference, ends: str, detectable: str
) -> None:
    text = sentence_of(difference)
    assert f"(95% confidence interval: {ends}; p = {difference.p:.4f})." in text
    assert "The difference is not significant." in text
    assert text.endswith(f" The test detects a difference above {detectable} with about 80% power.")


def test_the_detectable_difference_is_that_of_80_percent_power() -> None:
    stats = pytest.importorskip("scipy.stats")
    ratio = (stats.norm.ppf(0.975) + stats.norm.ppf(0.8)) / stats.norm.ppf(0.975)
    detectable = Difference(-0.1, -1.1, 0.9, 0.8).detectable_difference
    assert detectable == pytest.approx(ratio, rel=1e-6)
    assert FAR.detectable_difference is None
    assert Difference(-0.1, None, None, None).detectable_difference is None


def test_errors_in_percent_differ_by_percentage_points() -> None:
    text = sentence_of(Difference(0.7, -0.2, 1.6, 0.12), name="rte_small")
    assert text.startswith("The RTE on small of A is 0.70 percentage points higher than that of B (95%")
    assert "detects a difference above 1.29 percentage points with" in text


@pytest.mark.parametrize(
    ("amount", "decimals", "words"),
    [
        (0.0, 2, "two decimals"),
        (-0.0012, 2, "two decimals"),
        (0.004, 2, "two decimals"),
        (0.04, 1, "one decimal"),
    ],
)
def test_no_difference_is_called_lower_or_higher_by_zero(amount: float, decimals: int, words: str) -> None:
    difference = Difference(amount, amount - 0.001, amount + 0.001, 0.0003)
    assert sentence_of(difference, decimals=decimals) == f"A and B have the same MiD to {words}."


def test_digits_are_no_more_than_are_published() -> None:
    text = sentence_of(Difference(-0.4, -0.7, -0.1, 0.02), decimals=1)
    assert re.findall(r"\d+\.\d+", text)[:3] == ["0.4", "0.1", "0.7"]


@pytest.mark.parametrize(
    ("p_below", "words", "is_significant"),
    [
        (0.001, "p < 0.001", True),
        (0.01, "p < 0.01", True),
        (0.05, "p < 0.05", True),
        (1.0, "p ≥ 0.05", False),
    ],
)
def test_where_p_is_hidden_its_class_is_shown(p_below: float, words: str, is_significant: bool) -> None:
    text = sentence_of(Difference(-2.0, -3.0, -1.0, None, p_below))
    assert f"(95% confidence interval: 1.0 to 3.0 lower; {words})." in text
    assert ("The difference is not significant." in text) is not is_significant


def test_with_too_few_recordings_a_difference_means_nothing() -> None:
    text = sentence_of(Difference(-0.4, None, None, None))
    assert text == (
        "The MiD of A is 0.40 lower than that of B; "
        "there are too few recordings to say whether that is significant."
    )


@pytest.mark.parametrize(
    ("difference", "amount", "ends"),
    [
        (Difference(0.6, -25.0, 26.0, 0.9), "0.6 higher", "25.0 lower to 26.0 higher"),
        (Difference(10.51, 0.51, 20.6, 0.04), "10.5 higher", "0.5 to 20.6 higher"),
        (Difference(-0.06, -25.0, 26.0, 0.9), "0.06 lower", "26.00 higher to 25.00 lower"),
    ],
)
def test_no_number_of_a_sentence_is_doubled_by_rounding(
    difference: Difference, amount: str, ends: str
) -> None:
    text = sentence_of(difference)
    assert f" is {amount} than" in text
    assert f"interval: {ends};" in text


def test_a_pair_that_differs_in_few_units_says_so() -> None:
    few = Difference(0.01, n_effective=300.0, n_different=2, n_units=700)
    assert sentence_of(few).endswith(
        "; the methods differ in 2 of 700 recordings, too few to test (at least 6 needed)."
    )
    alike = sentence_of(Difference(0.0, n_effective=300.0, n_different=0, n_units=700))
    assert alike.endswith("decimals. They differ in 0 of 700 recordings.")
    hidden = sentence_of(Difference(0.1, n_effective=300.0))
    assert hidden.endswith("; the methods differ in few recordings, too few to test (at least 6 needed).")


def test_of_one_other_metric_the_sentence_is_in_the_singular() -> None:
    alike = Difference(0.1, -0.2, 0.4, 0.5)
    assert others({"mid": FAR, "rte": alike}, primary="mid") == (
        "The other metric does not differ significantly (p < 0.05, uncorrected)."
    )
    assert others({"mid": alike, "rte": FAR}, primary="mid") == (
        "The other metric differs significantly (p < 0.05, uncorrected): RTE overall."
    )


@pytest.mark.parametrize(
    ("n_sequences", "decimals", "words"),
    [
        (12_270, 2, "an error in 0 of 12,270 sequences (below 0.03% at 95%, if sequences were independent)"),
        (
            28_600,
            2,
            "an error in at most 1 of 28,600 sequences (below 0.02% at 95%, if sequences were independent)",
        ),
        (100, 2, "an error in 0 of 100 sequences (below 3% at 95%, if sequences were independent)"),
    ],
)
def test_no_error_is_a_bound_not_a_zero(n_sequences: int, decimals: int, words: str) -> None:
    (line,) = without_interval(
        {"warning_large": 0.0},
        counts={"large": n_sequences},
        decimals=decimals,
        n_effective={"warning_large": 300.0},
        unit="recording",
    )
    assert line == f"WE large: {words}"
