"""Rules of the house that no ready-made tool knows."""

import ast
import re
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PROGRAMS = ("evaluator", "tsttc_baselines", "leaderboard")
CODE = ("evaluator", "leaderboard", "tests", "benchmarks")
MAX_LINES = 600
# A name that says nothing collects everything.
FORBIDDEN_NAMES = {"utils", "helpers", "common", "misc", "services", "managers"}
STATUS_WRITERS = {Path("leaderboard/queue/lifecycle.py")}


def python_files(*folders: str) -> list[Path]:
    """Every source file of these folders, relative to the repository."""
    return sorted(
        path.relative_to(REPOSITORY)
        for folder in folders
        for path in (REPOSITORY / folder).rglob("*.py")
        if "__pycache__" not in path.parts
    )


def tree(path: Path) -> ast.Module:
    return ast.parse((REPOSITORY / path).read_text(encoding="utf-8"), filename=str(path))


def is_migration(path: Path) -> bool:
    return "migrations" in path.parts


def written_by_hand(*folders: str) -> list[Path]:
    return [path for path in python_files(*folders) if not is_migration(path)]


def text_of(path: Path) -> str:
    return (REPOSITORY / path).read_text(encoding="utf-8")


def test_every_file_is_short_enough_to_read() -> None:
    lengths = {path: len(text_of(path).splitlines()) for path in written_by_hand(*CODE)}
    assert {path: n_lines for path, n_lines in lengths.items() if n_lines > MAX_LINES} == {}


def test_every_module_is_named_for_what_it_holds() -> None:
    def names(path: Path) -> set[str]:
        return {part.removesuffix(".py").removeprefix("test_") for part in path.parts}

    # Tests start real services, and call them so.
    programs = python_files(*PROGRAMS, "benchmarks")
    assert [path for path in programs if names(path) & FORBIDDEN_NAMES] == []


# --- modules do not import each other --------------------------------------------------------------------


def statements_at_import(node: ast.AST) -> Iterator[ast.AST]:
    """What runs when the module is imported: not functions, and not what only a type checker reads."""
    for child in ast.iter_child_nodes(node):
        is_for_types = isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"
        if not is_for_types and not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            yield child
            yield from statements_at_import(child)


def imports_of(module: ast.Module, *, known: set[str]) -> set[str]:
    names = set[str]()
    for node in statements_at_import(module):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                names.add(inner if inner in known else str(node.module))
    return names & known


def without_circle(modules: dict[str, ast.Module]) -> list[str]:
    """The modules in an order of import. Raises `graphlib.CycleError`."""
    graph = {name: imports_of(module, known=set(modules)) - {name} for name, module in modules.items()}
    return list(TopologicalSorter(graph).static_order())


@pytest.mark.slow
def test_no_modules_import_each_other() -> None:
    modules = {
        ".".join(path.with_suffix("").parts).removesuffix(".__init__"): tree(path)
        for path in python_files(*PROGRAMS, "benchmarks")
    }
    assert len(without_circle(modules)) == len(modules)


def test_a_circle_of_imports_is_noticed() -> None:
    one, two = ast.parse("from a.two import x"), ast.parse("import numpy\nfrom a import one")
    with pytest.raises(CycleError):
        without_circle({"a.one": one, "a.two": two})
    late = ast.parse("def f():\n    from a.two import x")
    assert without_circle({"a.one": late, "a.two": two}) == ["a.one", "a.two"]


# --- only lifecycle.py writes a status -------------------------------------------------------------------


def status_writes(module: ast.Module) -> list[int]:
    """Lines that assign `….status`, or that pass a status to a call which writes rows."""
    lines = []
    for node in ast.walk(module):
        if isinstance(node, ast.Assign | ast.AugAssign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            lines += [t.lineno for t in targets if isinstance(t, ast.Attribute) and t.attr == "status"]
        if isinstance(node, ast.Call) and writes_a_status(node):
            lines.append(node.lineno)
    return lines


def writes_a_status(call: ast.Call) -> bool:
    """Whether this call is `update(status=…)` and the like, or an `Evaluation(status=…)`."""
    function = call.func
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    if name == "bulk_update":  # it takes the names of columns
        texts = {node.value for arg in call.args for node in ast.walk(arg) if isinstance(node, ast.Constant)}
        if "status" in texts:
            return True
    writers = {"update", "create", "get_or_create", "update_or_create", "Evaluation"}
    names: set[object] = {keyword.arg for keyword in call.keywords}
    for keyword in call.keywords:
        if keyword.arg == "defaults" and isinstance(keyword.value, ast.Dict):
            names |= {key.value for key in keyword.value.keys if isinstance(key, ast.Constant)}
    return name in writers and "status" in names


@pytest.mark.slow
def test_only_lifecycle_writes_a_status() -> None:
    writes = {path: status_writes(tree(path)) for path in written_by_hand("leaderboard")}
    assert {path for path, lines in writes.items() if lines} == STATUS_WRITERS


@pytest.mark.parametrize(
    "source",
    [
        "evaluation.status = Status.SCORED",
        "Evaluation.objects.filter(pk=1).update(status='SCORED')",
        "Evaluation(status='SCORED').save()",
        "Evaluation.objects.update_or_create(pk=1, defaults={'status': 'SCORED'})",
        "Evaluation.objects.bulk_update(rows, ['report', *('status', 'n_problems')])",
    ],
)
def test_the_rule_about_statuses_sees_every_way_to_write_one(source: str) -> None:
    assert status_writes(ast.parse(source)) == [1]


# --- a row that others name by a foreign key is locked without its key -------------------------------------


def locks_with_the_key(module: ast.Module) -> list[int]:
    """Lines that lock rows FOR UPDATE: a COMMIT elsewhere that checks a foreign key then waits for it.

    Who deletes a row has it FOR UPDATE by the deletion itself.
    """
    return [
        node.lineno
        for node in ast.walk(module)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr == "select_for_update"
        and "no_key" not in {keyword.arg for keyword in node.keywords}
    ]


@pytest.mark.slow
def test_no_row_is_locked_with_its_key() -> None:
    locks = {path: locks_with_the_key(tree(path)) for path in written_by_hand("leaderboard")}
    assert {path: lines for path, lines in locks.items() if lines} == {}
    assert locks_with_the_key(ast.parse("Split.objects.select_for_update(of=('self',)).get()")) == [1]


# --- habits that the house does without --------------------------------------------------------------------


def bad_habits(module: ast.Module, *, is_model: bool) -> set[str]:
    habits = set()
    for node in ast.walk(module):
        if isinstance(node, ast.ImportFrom) and node.module in {
            "django.db.models.signals",
            "django.dispatch",
        }:
            habits.add("signals")
        if isinstance(node, ast.FunctionDef) and node.name == "save" and is_model:
            habits.add("save() override")
    return habits


@pytest.mark.slow
def test_no_signal_is_connected_and_no_save_is_overridden() -> None:
    habits_by_path = {
        path: bad_habits(tree(path), is_model="models" in path.parts) for path in python_files(*PROGRAMS)
    }
    assert {path: habits for path, habits in habits_by_path.items() if habits} == {}


def test_every_ignore_carries_its_reason() -> None:
    marker = re.compile(r"#\s*(?:noqa|type:\s*ignore|pragma)")
    reasoned = re.compile(r"#\s*(?:noqa: [A-Z0-9, ]+|type: ignore\[[a-z-, ]+\])\s*(?:--?|#)\s*\S.{5,}")
    bare = [
        f"{path}:{number}: {line.strip()}"
        for path in written_by_hand(*PROGRAMS)
        for number, line in enumerate(text_of(path).splitlines(), 1)
        if marker.search(line) and not reasoned.search(line)
    ]
    assert bare == []
