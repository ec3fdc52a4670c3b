"""The references of the Python packages, as Markdown below their guides.

It reads the sources and imports nothing: a server has neither OpenCV nor torch, which some modules need.
"""

import ast
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Final

from django.conf import settings
from django.utils.text import slugify

_ROOT: Final = Path(settings.BASE_DIR)
_MAX_WIDTH: Final = 76
# The default of a dataclass's field, where it is written as a call.
_FIELD: Final = re.compile(r"\bfield\((?:default=([\w.]+))?.*\)$")

SECTIONS: Final[dict[str, dict[str, dict[str, tuple[str, ...]]]]] = {
    "python-reference": {
        "Read and write": {
            "evaluator": (
                *("read_predictions", "write_predictions", "convert", "read_truth", "read_manifest"),
                *("read_numbering", "manifest_frame", "predictions_from_frame"),
            ),
        },
        "Score": {
            "evaluator": (
                *("evaluate", "get_protocol", "rounded", "format_rounded"),
                *("PROTOCOLS", "SCORE_NAMES", "TTC_RANGES"),
            )
        },
        "Compare": {"evaluator": ("compare_predictions", "confidence_intervals", "Difference")},
        "Scale ratios": {
            "evaluator": ("scale_ratio_to_ttc", "ttc_to_scale_ratio", "convert_rate", "fps_of_gap"),
        },
        "Files and scores": {
            "evaluator": (
                *("Predictions", "GroundTruth", "Manifest", "Table", "Report", "RangeScore", "Protocol"),
                *("Rejected", "Problem", "PROBLEM_CODES"),
            ),
            "evaluator.metrics.protocol": ("TTCRange",),
            "evaluator.metrics.registry": ("Metric", "Terms"),
            "evaluator.problems": ("FileWarning",),
            "evaluator.scoring.results": ("Details", "GroupScores", "RecordingSums"),
            "evaluator.scoring.significance": ("Influence",),
            "evaluator.truth.numbering": ("Numbering",),
            "evaluator.truth.objects": ("Objects",),
            "evaluator.units": ("Units",),
        },
        "Client of a leaderboard": {
            "evaluator": ("Client", "ClientError"),
            "evaluator.client.answers": (
                *("Account", "Board", "BoardEntry", "Compared", "ConfidenceInterval", "Method", "Pair"),
                *("Queue", "Quota", "Submission", "VisibilityPreview", "BoardPreview", "RankChange"),
                *("BadAnswer", "Refused", "TimedOut", "Unreachable"),
            ),
            "evaluator.client.exchange": ("RetryPolicy",),
        },
        "With torch": {
            "evaluator.torch": ("ScoreMetric",),
            "evaluator.lightning": ("ScoreCallback",),
        },
    },
    "baselines-reference": {
        "Frames": {
            "tsttc_baselines.folders": ("read_folder", "read_folder_truth", "SequenceFolder"),
            "tsttc_baselines.images": ("ImageCache",),
            "tsttc_baselines.clips": ("Clip",),
            "tsttc_baselines.boxes": ("scale_ratio_of_boxes", "expand", "is_usable"),
        },
        "Methods": {
            "tsttc_baselines.estimates": ("Estimator", "Estimate", "Unusable"),
            "tsttc_baselines.methods": ("get_method", "Method", "Parameter"),
            "tsttc_baselines.own_methods": ("find_method",),
            "tsttc_baselines.running": ("run_method", "Run"),
        },
        "Networks": {
            "tsttc_baselines.torch": ("BoxCrops", "crops_of", "crops_of_clip"),
            "tsttc_baselines.pairs": ("Source",),
            "tsttc_baselines.deep_scale.weights": ("read_weights", "write_weights", "Weights", "Use"),
            "tsttc_baselines.methods": ("OWN_WEIGHTS",),
        },
    },
}
"""By guide and title: public names by the modules from which they are imported."""

_Definition = ast.FunctionDef | ast.ClassDef


def text(guide: str) -> str:
    """The reference of a package as Markdown, for its guide."""
    parts: list[str] = []
    for title, modules in SECTIONS[guide].items():
        mark = "- " if len(modules) > 1 else ""
        parts += [f"## {title}", ""]
        parts += [f"{mark}From `{module}`: {_links(module, names)}" for module, names in modules.items()]
        parts += [""]
        for module, names in modules.items():
            for name in names:
                parts += _entry(name, module)
    return "\n".join(parts)


def _types(signature: str, package: str) -> Iterator[str]:
    """Links to the classes that a signature names; of two with one name to that of the package."""
    modules = [each for sections in SECTIONS.values() for part in sections.values() for each in part.items()]
    every = [(name, module) for module, names in modules for name in names]
    homes = dict(sorted(every, key=lambda each: each[1].startswith(package)))
    named = dict.fromkeys(name for name in re.findall(r"\b[A-Z][a-z]\w+", signature) if name in homes)
    if named:
        yield from (f"Types: {', '.join(_links(homes[name], [name]) for name in named)}.", "")


def _links(module: str, names: Iterable[str]) -> str:
    """Links to the names of a module."""
    page = "baselines-reference.md" if module.startswith("tsttc_baselines") else "python-reference.md"
    return ", ".join(f"[`{name}`]({page}#{slugify(f'{module}.{name}')})" for name in names)


@cache
def _homes() -> dict[str, str]:
    """The public names of `evaluator`, and the module that defines each."""
    tree = _tree("evaluator")
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module]
    return {
        alias.name: str(node.module)
        for node in imports
        for alias in node.names
        if str(node.module).startswith("evaluator.")
    }


@cache
def _tree(module: str) -> ast.Module:
    path = _ROOT.joinpath(*module.split("."))
    source = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return ast.parse(source.read_text(encoding="utf-8"))


def _entry(name: str, module: str) -> Iterator[str]:
    """A heading, the docstring and the arguments of a name; of a class its public members as well.

    Raises `KeyError` for a name that the module does not define.
    """
    home = _homes()[name] if module == "evaluator" else module
    body = _tree(home).body
    is_function = any(isinstance(node, ast.FunctionDef) and node.name == name for node in body)
    yield f"### {module}.{name}{'()' if is_function else ''}"
    yield ""
    for number, node in enumerate(body):
        if isinstance(node, _Definition) and node.name == name:
            signature = _signature(node)
            yield from _code(signature)
            yield from _words(ast.get_docstring(node))
            yield from _types(signature.partition("(")[2], module.partition(".")[0])
            if isinstance(node, ast.ClassDef):
                yield from _members(node)
            return
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.target.id == name:
            following = body[number + 1] if number + 1 < len(body) else None
            yield from _words(_string(following))
            return
    raise KeyError(f"{home} does not define {name}")


def _members(node: ast.ClassDef) -> Iterator[str]:
    """The public methods and properties of a class, as two lists."""
    groups: dict[str, list[str]] = {"Properties": [], "Methods": []}
    for each in node.body:
        if not isinstance(each, ast.FunctionDef) or each.name.startswith("_"):
            continue
        marks = {ast.unparse(mark).rpartition(".")[2] for mark in each.decorator_list}
        call = "" if marks & {"property", "cached_property"} else f"`{_call(each)}`"
        about = (ast.get_docstring(each) or "").partition("\n\n")[0].replace("\n", " ")
        end = "\\\n  " if call else ": "  # a call has its own line
        groups["Methods" if call else "Properties"].append(f"- **`{each.name}`**{call}{end}{about}")
    for title, lines in groups.items():
        if lines:
            yield from (f"{title}:", "", *lines, "")


def _signature(node: _Definition) -> str:
    """How it is called: a function's arguments and result, or the fields of a dataclass."""
    if isinstance(node, ast.ClassDef):
        made = next((e for e in node.body if isinstance(e, ast.FunctionDef) and e.name == "__init__"), None)
        fields = [
            _FIELD.sub(lambda match: match[1] or "…", ast.unparse(each))
            for each in node.body
            if isinstance(each, ast.AnnAssign)
        ]
        is_keyword_only = any("kw_only=True" in ast.unparse(mark) for mark in node.decorator_list)
        parts = _arguments(made) if made else [*(["*"] if is_keyword_only else []), *fields]
        is_abstract = any(ast.unparse(base) in {"Protocol", "Exception"} for base in node.bases)
        return "" if is_abstract else _wrapped(f"class {node.name}", parts, "")
    return _wrapped(node.name, _arguments(node), _result(node))


def _call(node: ast.FunctionDef) -> str:
    return f"({', '.join(_arguments(node))}){_result(node)}"


def _result(node: ast.FunctionDef) -> str:
    # An arrow of two signs would break between them on a phone.
    return f" → {ast.unparse(node.returns)}" if node.returns else ""


def _arguments(node: ast.FunctionDef) -> list[str]:
    """The arguments as they are written, without the first of a method."""
    parts, depth = [""], 0
    for character in ast.unparse(node.args):
        depth += (character in "([{") - (character in ")]}")
        if character == "," and not depth:
            parts.append("")
        else:
            parts[-1] += character
    arguments = [part.strip() for part in parts if part.strip() not in {"", "self", "cls"}]
    return [re.sub(r"^(\w+: [^=]+)=", r"\1 = ", argument) for argument in arguments]


def _wrapped(shown: str, parts: list[str], result: str) -> str:
    line = f"{shown}({', '.join(parts)}){result}"
    if len(line) <= _MAX_WIDTH:
        return line
    return f"{shown}(\n" + "".join(f"    {part},\n" for part in parts) + f"){result}"


def _code(signature: str) -> Iterator[str]:
    if signature:
        yield from ("```text", signature, "```", "")


def _words(docstring: str | None) -> Iterator[str]:
    """A docstring as Markdown: its examples become blocks of code."""
    if docstring:
        yield re.sub(r"(?m)(^>>>(?:.+\n?)+)", r"```python\n\1\n```\n", docstring)
        yield ""


def _string(node: ast.stmt | None) -> str | None:
    """The text of a bare string, as below a constant."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return str(node.value.value)
    return None
