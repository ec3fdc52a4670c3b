"""A fault planted in a process that has imported the product already.

The code of functions is exchanged, whoever holds them; so a new process, with all modules and tests in it,
costs a fork. What another program runs, a started `tsttc` for example, has no fault.
"""

import ast
import gc
import sys
from pathlib import Path
from types import CellType, CodeType, FunctionType

from tests.mutants.faults import Fault


class NotPlantable(Exception):
    """Nothing in this process would run the fault."""


def plant(fault: Fault, *, root: Path) -> None:
    """Let this process run the fault from now on.

    Raises:
        NotPlantable: no function has this code, or the changed code does not compile.
    """
    gc.unfreeze()  # what is frozen is not found
    path = root / fault.path
    source = fault.text(path.read_bytes())
    if fault.constant:
        _exchange_constant(fault, path, source)
        return
    if fault.decorator is not None:
        _drop_decorator(fault, path)
        return
    try:
        code = compile(source, str(path), "exec")
    except SyntaxError as error:
        raise NotPlantable(str(error)) from error
    around = {_key(inner): inner for inner in _codes(code) if _holds(inner, fault.line)}
    functions = [function for function in _functions(path) if _key(function.__code__) in around]
    if not functions:
        raise NotPlantable("no function runs it")
    for function in functions:
        new = around[_key(function.__code__)]
        if new.co_freevars != function.__code__.co_freevars:
            raise NotPlantable("it has other free variables")
        function.__code__ = new


def _exchange_constant(fault: Fault, path: Path, source: bytes) -> None:
    module = next((m for m in list(sys.modules.values()) if getattr(m, "__file__", None) == str(path)), None)
    if module is None or not hasattr(module, fault.constant):
        raise NotPlantable("nothing imports it")
    statement = next(
        s for s in ast.parse(source).body if s.lineno <= fault.line <= (s.end_lineno or s.lineno)
    )
    names = dict(vars(module))
    try:
        exec(compile(ast.Module([statement], []), str(path), "exec"), names)
    except Exception as error:
        raise NotPlantable(str(error)) from error
    old, new = getattr(module, fault.constant), names[fault.constant]
    for other in list(sys.modules.values()):
        if vars(other).get(fault.constant) is old:
            setattr(other, fault.constant, new)


def _drop_decorator(fault: Fault, path: Path) -> None:
    """Put what is decorated in the place of what came of it."""
    assert fault.decorator is not None
    n_outside, n_decorators = fault.decorator
    everything = [f for f in gc.get_objects() if type(f) is FunctionType]
    wrappers = {id(f.__wrapped__): f for f in everything if hasattr(f, "__wrapped__")}
    functions = [f for f in _functions(path) if _holds(f.__code__, fault.first) and id(f) in wrappers]
    if len(functions) != 1:
        raise NotPlantable("its decorators hide it")
    chain = functions
    while id(chain[-1]) in wrappers:
        chain.append(wrappers[id(chain[-1])])
    if len(chain) != n_decorators + 1:
        raise NotPlantable("its decorators hide it")
    wrapper, inner = chain[n_decorators - n_outside], chain[n_decorators - n_outside - 1]
    for holder in gc.get_referrers(wrapper):
        if holder is not chain:
            _replace(holder, wrapper, inner)


def _replace(holder: object, old: FunctionType, new: FunctionType) -> None:
    match holder:
        case dict():
            holder.update({name: new for name, value in holder.items() if value is old})
        case list():
            holder[:] = [new if value is old else value for value in holder]
        case CellType():
            holder.cell_contents = new
        case _ if hasattr(holder, "__dict__") and isinstance(vars(holder), dict):
            _replace(vars(holder), old, new)


def _functions(path: Path) -> list[FunctionType]:
    # `isinstance` would wake up lazy objects.
    name = str(path)
    return [f for f in gc.get_objects() if type(f) is FunctionType and f.__code__.co_filename == name]


def _codes(code: CodeType) -> list[CodeType]:
    inner = [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    return inner + [deeper for one in inner for deeper in _codes(one)]


def _holds(code: CodeType, line: int) -> bool:
    return any(number == line for _, _, number in code.co_lines()) or any(
        _holds(inner, line) for inner in code.co_consts if isinstance(inner, CodeType)
    )


def _key(code: CodeType) -> tuple[str, int]:
    return code.co_qualname, code.co_firstlineno
