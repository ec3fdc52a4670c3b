"""Equations of guides as MathML, from the few commands of TeX that the guides use."""

import re
from typing import Final

from django.utils.html import escape

_TOKEN: Final = re.compile(r"\\text\{[^}]*\}|\\[A-Za-z]+|[0-9][0-9.,]*|\S")
_GREEK: Final = {"alpha": "α", "delta": "δ", "nu": "ν", "theta": "θ", "tau": "τ", "Phi": "Φ"}
_OPERATORS: Final = {"-": "−", r"\cdot": "·", r"\sum": "∑", **{each: each for each in "+=|/±≥"}}
_SYMBOLS: Final = {
    **{rf"\{name}": f"<mi>{letter}</mi>" for name, letter in _GREEK.items()},
    **{token: f"<mo>{sign}</mo>" for token, sign in _OPERATORS.items()},
    # As tall as a line, also beside a fraction.
    **{each: f'<mo stretchy="false">{each}</mo>' for each in "()"},
    r"\ln": '<mrow><mi>ln</mi><mspace width=".15em"></mspace></mrow>',
}
# With the number of arguments.
_COMMANDS: Final = {
    r"\frac": (2, "<mfrac>{}{}</mfrac>"),
    r"\sqrt": (1, "<msqrt>{}</msqrt>"),
    r"\hat": (1, '<mover accent="true">{}<mo stretchy="false">^</mo></mover>'),
}


def mathml(tex: str, *, display: str = "block") -> str:
    r"""Return the equation, on a line of its own or `inline`. Raises `ValueError` for an unknown command.

    >>> mathml(r"\hat{x}_1")[22:-7]
    '<msub><mover accent="true"><mi>x</mi><mo stretchy="false">^</mo></mover><mn>1</mn></msub>'
    """
    return f'<math display="{display}">{_row(_TOKEN.findall(tex)[::-1])}</math>'


def _row(tokens: list[str]) -> str:
    parts = []
    while tokens and tokens[-1] != "}":
        parts.append(_scripted(tokens))
    return parts[0] if len(parts) == 1 else f"<mrow>{''.join(parts)}</mrow>"


def _scripted(tokens: list[str]) -> str:
    base = _atom(tokens)
    for mark, tag in (("_", "msub"), ("^", "msup")):
        if tokens and tokens[-1] == mark:
            tokens.pop()
            base = f"<{tag}>{base}{_atom(tokens)}</{tag}>"
    return base


def _atom(tokens: list[str]) -> str:
    read = tokens.pop()
    if read in _COMMANDS:
        n_arguments, drawn = _COMMANDS[read]
        return drawn.format(*(_atom(tokens) for _ in range(n_arguments)))
    if read == "{":
        row = _row(tokens)
        tokens.pop()
        return row
    if read.startswith(r"\text"):
        return f"<mtext>{escape(read[6:-1])}</mtext>"
    if read[0].isdigit():
        return f"<mn>{read}</mn>"
    if read not in _SYMBOLS and not read.isalpha():
        raise ValueError(f"{read!r} is not known in an equation; expected one of {' '.join(_SYMBOLS)}")
    return _SYMBOLS.get(read, f"<mi>{read}</mi>")
