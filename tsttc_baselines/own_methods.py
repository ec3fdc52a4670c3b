"""Methods of other packages: MODULE:NAME, or an entry point of `tsttc.methods`.

What is named is a class, whose arguments by keyword are the method's parameters, or a `Method`:

    class Net:
        def __init__(self, *, weights: Path) -> None: ...
        def __call__(self, clip: Clip, *, frame_gap: int) -> Estimate: ...
"""

from __future__ import annotations

import hashlib
import inspect
import sys
import traceback
from dataclasses import replace
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Final

from evaluator.hidden_files import is_hidden
from tsttc_baselines.methods import METHODS, Method, Parameter, Value

GROUP: Final = "tsttc.methods"

_KINDS: Final[dict[str, type]] = {"str": str, "int": int, "float": float, "Path": Path}


class MethodMissing(Exception):
    """There is no such method, or it cannot be loaded; the message says why."""


def find_method(name: str) -> Method:
    """Return a method by its name: of this package, of an installed package, or "module:name".

    Raises `MethodMissing` if there is none.
    """
    for method in METHODS:
        if method.name == name:
            return method
    if ":" in name:
        return _loaded(name, name=name)
    for point in points():
        if point.name == name:
            return _loaded(point.value, name=name)
    known = ", ".join([*(method.name for method in METHODS), *(point.name for point in points())])
    raise MethodMissing(f"There is no method {name!r}; expected {known}, or MODULE:NAME.")


def points() -> tuple[EntryPoint, ...]:
    """The entry points of installed packages, by their names."""
    return tuple(sorted(entry_points(group=GROUP), key=lambda point: point.name))


def is_own(method: Method) -> bool:
    """Whether it is a method of another package."""
    return method not in METHODS


def _loaded(factory: str, *, name: str) -> Method:
    module, _, attribute = factory.partition(":")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)  # as the last: a file there must not hide a module that others import
    try:
        named: Any = import_module(module)
        for part in attribute.split("."):
            named = getattr(named, part)
        if isinstance(named, Method):
            return replace(named, name=name)
        if not callable(named):
            raise TypeError(f"{attribute} is neither a class nor a Method")
        summary = (inspect.getdoc(named) or "A method without a docstring.").splitlines()[0]
        parameters = tuple(map(_parameter, _keywords(named)))
    except Exception as error:  # noqa: BLE001 -- a foreign module may fail at anything
        cause = f"{type(error).__name__}: {error}{line_of(error, factory)}"
        raise MethodMissing(f"The method {name} cannot be loaded ({cause}).") from None
    return Method(name, attribute, summary, factory, parameters)


def _keywords(factory: Any) -> list[inspect.Parameter]:
    kinds = (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return [each for each in inspect.signature(factory).parameters.values() if each.kind in kinds]


def _parameter(keyword: inspect.Parameter) -> Parameter:
    """The parameter of a keyword: its kind is that of the annotation, else of the default, else a text."""
    annotation = keyword.annotation
    named = annotation if isinstance(annotation, str) else getattr(annotation, "__name__", "")
    is_required = keyword.default is inspect.Parameter.empty
    default: Value = None if is_required else keyword.default
    kind = _KINDS.get(named.rpartition(".")[2]) or next(
        (kind for kind in _KINDS.values() if isinstance(default, kind)), str
    )
    return Parameter(keyword.name, default, f"Of {named or 'any type'}.", kind, is_required=is_required)


def line_of(error: BaseException, factory: str) -> str:
    """The last line of the method's package that an error passed, as ", line 8 of net.py", else nothing."""
    lines = [
        f", line {number} of {Path(frame.f_code.co_filename).name}"
        for frame, number in traceback.walk_tb(error.__traceback__)
        if _package(str(frame.f_globals.get("__name__"))) == _package(factory)
    ]
    return lines[-1] if lines else ""


def _package(name: str) -> str:
    return name.partition(":")[0].partition(".")[0]


def code_of(method: Method) -> dict[str, str]:
    """The factory, and the SHA-256 of the Python files of its package, which say what ran."""
    top = import_module(_package(method.factory))
    folders = [Path(folder) for folder in getattr(top, "__path__", ())]
    sources = [
        file for folder in folders for file in folder.rglob("*.py") if not is_hidden(file.relative_to(folder))
    ]
    files = sorted(sources) or [Path(str(top.__file__))]
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return {"factory": method.factory, "sha256": digest.hexdigest()}
