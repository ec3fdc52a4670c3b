"""Names that are one slip of the finger apart."""

from collections.abc import Iterable

_SEPARATORS = str.maketrans("", "", " -_./")
_DIGITS = str.maketrans("", "", "0123456789")
# Short names are one letter apart without any slip.
_LENGTH_OF_ONE_SLIP = 4
_LENGTH_OF_TWO_SLIPS = 6


def similar_name(name: str, others: Iterable[str]) -> str | None:
    """Return the first of the other names that this one may be a misspelling of.

    They differ by case, by separators, or by one or two letters. Names that differ by a number alone are two
    versions.

    >>> similar_name("ttc former", ["Other", "TTC-Former"]), similar_name("TTC-Fromer", ["TTC-Former"])
    ('TTC-Former', 'TTC-Former')
    >>> similar_name("TTC-Former v2", ["TTC-Former", "TTC-Former v1"]), similar_name("Bar", ["Baz"])
    (None, None)
    """
    folded = _folded(name)
    return next((other for other in others if other != name and _are_close(folded, _folded(other))), None)


def _folded(name: str) -> str:
    return name.casefold().translate(_SEPARATORS)


def _are_close(first: str, second: str) -> bool:
    if first == second:
        return True
    without_digits = [text.translate(_DIGITS) for text in (first, second)]
    if without_digits[0].removesuffix("v") == without_digits[1].removesuffix("v"):
        return False
    length = min(len(first), len(second))
    if length < _LENGTH_OF_ONE_SLIP:
        return False
    return _distance(first, second) <= (2 if length >= _LENGTH_OF_TWO_SLIPS else 1)


def _distance(first: str, second: str) -> int:
    """Count the letters to insert, remove or replace (Levenshtein)."""
    previous = list(range(len(second) + 1))
    for row, letter in enumerate(first, start=1):
        current = [row]
        for column, other in enumerate(second, start=1):
            replaced = previous[column - 1] + (letter != other)
            current.append(min(replaced, previous[column] + 1, current[-1] + 1))
        previous = current
    return previous[-1]
