"""Small faults that could be planted in a file: each is a change of one place of its text."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

_COMPARISONS = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==",
    ast.Is: "is not", ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in",
}  # fmt: skip
_ARITHMETIC = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}
_NAMES = {
    "min": "max", "max": "min", "any": "all", "all": "any", "fmin": "fmax", "fmax": "fmin",
    "minimum": "maximum", "maximum": "minimum", "Min": "Max", "Max": "Min",
}  # fmt: skip
# Calls whose keywords choose rows.
_FILTERS = {"filter", "exclude", "get", "Q", "get_or_create", "update_or_create", "get_object_or_404"}
# Without these a program does not start, or nothing is there to notice.
_LASTING = {
    "property", "cached_property", "staticmethod", "classmethod", "dataclass", "overload", "abstractmethod",
    "contextmanager", "register", "shared_task", "override", "setter", "wraps",
}  # fmt: skip


@dataclass(frozen=True)
class Fault:
    """A text in the place of another."""

    path: str
    line: int
    start: int  # in bytes
    end: int
    old: str
    new: str
    # Who runs one of these lines meets the fault.
    first: int
    last: int
    # The name that a module gives to the changed value.
    constant: str = ""
    # How many decorators are outside of the dropped one, and how many there are.
    decorator: tuple[int, int] | None = None

    def __str__(self) -> str:
        return f"{self.path}:{self.line}  {self.change}"

    @property
    def change(self) -> str:
        """The change on one line, as the list of equivalent faults names it."""
        old, new = (" ".join(text.split()) for text in (self.old, self.new))
        return f"{old} -> {new or '(nothing)'}"

    def text(self, source: bytes) -> bytes:
        """The file with the fault in it."""
        return source[: self.start] + self.new.encode() + source[self.end :]


def of_file(path: str, root: Path) -> list[Fault]:
    """Every fault that could be planted in this file.

    What runs only when a module is imported is left alone (fields of models, defaults of arguments), except
    constants, which can be exchanged later, and decorators.
    """
    source = (root / path).read_bytes()
    every = set(_Finder(path, source).of_module(ast.parse(source)))
    return sorted(every, key=lambda fault: (fault.start, fault.end, fault.new))


class _Finder:
    def __init__(self, path: str, source: bytes) -> None:
        self.path = path
        self.source = source
        self.starts = [0]
        for line in source.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))

    def of_module(self, module: ast.Module) -> Iterator[Fault]:
        for statement in module.body:
            match statement:
                case ast.Assign(value=ast.Subscript()):
                    pass  # the name of a type
                case ast.Assign(targets=[ast.Name(id=name)], value=value):
                    yield from self.of_constant(name, value)
                case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
                    yield from self.of_constant(name, value)
                case ast.ClassDef() | ast.FunctionDef():
                    yield from self.of_definition(statement)

    def of_constant(self, name: str, value: ast.expr) -> Iterator[Fault]:
        for old, new in self.changes(value):
            yield self.fault(old, new, first=value.lineno, last=value.end_lineno, constant=name)

    def of_definition(self, definition: ast.stmt) -> Iterator[Fault]:
        if isinstance(definition, ast.ClassDef):
            for statement in definition.body:
                yield from self.of_definition(statement)
        elif isinstance(definition, ast.FunctionDef):
            yield from self.of_decorators(definition)
            for statement in definition.body:
                yield from self.of_statement(statement)

    def of_decorators(self, function: ast.FunctionDef) -> Iterator[Fault]:
        decorators, body = function.decorator_list, function.body
        for i, decorator in enumerate(decorators):
            if _LASTING & {_name(node) for node in ast.walk(decorator)}:
                continue
            fault = self.fault(decorator, "", first=body[0].lineno, last=body[-1].end_lineno)
            yield replace(fault, start=fault.start - 1, old=f"@{fault.old}", decorator=(i, len(decorators)))

    def of_statement(self, statement: ast.stmt) -> Iterator[Fault]:
        """Of a statement in a function. Only the lines of its own, without its block, lead to a fault."""
        block = [child.lineno - 1 for child in ast.iter_child_nodes(statement) if isinstance(child, ast.stmt)]
        last = max(min([*block, statement.end_lineno or 0]), statement.lineno)
        if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call):
            yield self.fault(statement.value, "pass", first=statement.lineno, last=last)
        if (
            isinstance(statement, ast.Return)
            and statement.value is not None
            and not _is_none(statement.value)
        ):
            yield self.fault(statement.value, "None", first=statement.lineno, last=last)
        inner: list[ast.stmt] = []
        for child in ast.iter_child_nodes(statement):
            if isinstance(child, ast.stmt):
                inner.append(child)
            elif isinstance(child, ast.ExceptHandler | ast.match_case):
                inner += child.body
            elif not isinstance(statement, ast.FunctionDef | ast.ClassDef):
                is_annotation = isinstance(statement, ast.AnnAssign) and child is statement.annotation
                for old, new in () if is_annotation else self.changes(child):
                    yield self.fault(old, new, first=statement.lineno, last=last)
        for one in inner:
            yield from self.of_statement(one)

    def changes(self, tree: ast.AST) -> Iterator[tuple[ast.expr, str]]:
        """The places of an expression and what could stand there."""
        for node in _walk(tree):
            yield from self.of_operator(node)
            match node:
                case ast.Constant(value=bool() as truth):
                    yield node, str(not truth)
                case ast.Constant(value=int() | float() as number):
                    yield node, str(number + 1)
                    yield node, str(number * 1.01 if isinstance(number, float) and number else number - 1)
                case ast.Name(id=name) if name in _NAMES:
                    yield node, _NAMES[name]
                case ast.Attribute(value=value, attr=name) if name in _NAMES:
                    yield node, f"({self.text_of(value)}).{_NAMES[name]}"
                case ast.Call():
                    yield from self.of_call(node)
                case ast.Tuple() | ast.Set() | ast.List() if len(node.elts) > 2:
                    is_slice = any(isinstance(part, ast.Slice) for part in node.elts)
                    if not is_slice and isinstance(getattr(node, "ctx", ast.Load()), ast.Load):
                        yield from ((node, self.without(node, node.elts, part)) for part in node.elts)

    def of_operator(self, node: ast.AST) -> Iterator[tuple[ast.expr, str]]:
        match node:
            case ast.Compare(ops=[op]) if type(op) in _COMPARISONS:
                left, right = self.text_of(node.left), self.text_of(node.comparators[0])
                yield node, f"({left}) {_COMPARISONS[type(op)]} ({right})"
            case ast.BoolOp(op=op, values=values):
                word = " or " if isinstance(op, ast.And) else " and "
                yield node, f"({word.join(f'({self.text_of(value)})' for value in values)})"
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                yield node, f"bool({self.text_of(operand)})"
            case ast.IfExp(test=test):
                yield test, f"not ({self.text_of(test)})"
            case ast.BinOp(op=op) if type(op) in _ARITHMETIC:
                left, right = self.text_of(node.left), self.text_of(node.right)
                yield node, f"({left}) {_ARITHMETIC[type(op)]} ({right})"

    def of_call(self, call: ast.Call) -> Iterator[tuple[ast.expr, str]]:
        """A condition of a query that is left out, and a part of its order."""
        name = _name(call.func)
        parts: list[ast.expr | ast.keyword] = [*call.args, *call.keywords]
        if name in _FILTERS:
            dropped = [*call.keywords, *(arg for arg in call.args if len(parts) > 1 and name != "get")]
        elif name == "order_by":
            dropped = list(call.args)
        else:
            return
        for part in dropped:
            rest = ", ".join(self.text_of(other) for other in parts if other is not part)
            yield call, f"{self.text_of(call.func)}({rest})"

    def without(self, node: ast.expr, parts: list[ast.expr], part: ast.expr) -> str:
        rest = ", ".join(self.text_of(other) for other in parts if other is not part)
        return (
            f"({rest})"
            if isinstance(node, ast.Tuple)
            else f"{{{rest}}}"
            if isinstance(node, ast.Set)
            else f"[{rest}]"
        )

    def fault(self, node: ast.expr, new: str, *, first: int, last: int | None, constant: str = "") -> Fault:
        start = self.offset(node.lineno, node.col_offset)
        end = self.offset(node.end_lineno, node.end_col_offset)
        old = self.source[start:end].decode()
        return Fault(self.path, node.lineno, start, end, old, new, first, last or first, constant)

    def offset(self, line: int | None, column: int | None) -> int:
        return self.starts[(line or 1) - 1] + (column or 0)

    def text_of(self, node: ast.expr | ast.keyword) -> str:
        start, end = (
            self.offset(node.lineno, node.col_offset),
            self.offset(node.end_lineno, node.end_col_offset),
        )
        return self.source[start:end].decode()


def _name(node: ast.AST) -> str:
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


def _is_none(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and node.value is None


def _walk(tree: ast.AST) -> Iterator[ast.AST]:
    """The nodes, without those in f-strings, whose places some versions of Python do not tell.

    Nor whether `zip` asks for equal lengths, which it gets.
    """
    yield tree
    for child in ast.iter_child_nodes(tree):
        is_strict = isinstance(child, ast.keyword) and child.arg == "strict"
        if not isinstance(child, ast.JoinedStr) and not is_strict:
            yield from _walk(child)
