"""A command file of code_aster as a list of commands: its Python is read as a tree, and only what is harmless of it is
evaluated: numbers, texts, arithmetic, assignments, conditions, loops, and functions of these.  No dolfinx here.
"""

from __future__ import annotations

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from signorini_fx.addons.aster.values import (
    AsterCommand,
    CommandError,
    Concept,
    Parameters,
    Unknown,
    UserFunction,
    interpolated,
)
from signorini_fx.errors import MeshError

_ARITHMETIC: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Not: operator.not_,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.In: lambda a, b: a in b,
    ast.NotIn: lambda a, b: a not in b,
    ast.Is: operator.is_,
    ast.IsNot: operator.is_not,
}
_OF_MATH = ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "log10")
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: getattr(math, name) for name in (*_OF_MATH, "floor", "ceil", "fabs", "hypot", "radians", "degrees")},
    **{"abs": abs, "float": float, "int": int, "max": max, "min": min, "len": len, "sum": sum, "round": round},
    **{"str": str, "tuple": tuple, "list": list, "range": range, "enumerate": enumerate, "zip": zip, "pow": math.pow},
}
_CONSTANTS = {"pi": math.pi, "e": math.e, "True": True, "False": False, "None": None}
# What a file may ask for: statements and terms that are evaluated in all, the depth of calls, letters of a text.
_MOST_EVALUATED, _DEEPEST, _LONGEST = 2_000_000, 40, 10_000


class _Returned(Exception):
    """A function has ended."""

    def __init__(self, value: Any) -> None:
        self.value = value
        super().__init__()


@dataclass
class CommandFile:
    """What a command file says.

    Attributes:
        commands: one after the other, as they are called.
        concepts: what they make, in their order.
        unread: lines that are not evaluated, and why.
    """

    commands: list[AsterCommand] = field(default_factory=list)
    concepts: list[Concept] = field(default_factory=list)
    unread: list[tuple[int, str]] = field(default_factory=list)

    def named(self, *names: str) -> list[AsterCommand]:
        """The commands with these names, in their order."""
        return [command for command in self.commands if command.name in names]


def read_commands(file: Path) -> CommandFile:
    """The commands of a file.

    Raises:
        MeshError: it cannot be read, or is no text of Python.
    """
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # of texts with a backslash
            tree = ast.parse(text)
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror}") from None
    except SyntaxError as error:
        raise MeshError(f"{file}: line {error.lineno}: this is no command file: {error.msg}") from None
    except (ValueError, RecursionError, MemoryError) as error:
        raise MeshError(f"{file}: this is no command file: {error or type(error).__name__}") from None
    evaluator = _CommandReader()
    try:
        evaluator.run(tree.body, evaluator.variables)
    except CommandError as error:
        raise MeshError(f"{file}: {error.text}") from None
    except RecursionError:
        raise MeshError(f"{file}: its terms are nested too deeply") from None
    return evaluator.content


class _CommandReader:
    """Evaluates statements, and collects the commands."""

    def __init__(self) -> None:
        self.content = CommandFile()
        self.variables: dict[str, Any] = {}
        self._evaluated = 0
        self._depth = 0

    # --- statements ---------------------------------------------------------------------------------------------------

    def run(self, statements: Iterable[ast.stmt], scope: dict[str, Any]) -> None:
        for statement in statements:
            self._count(statement)
            match statement:
                case ast.Assign(targets=targets, value=value):
                    result = self._assigned(value, scope, targets[0])
                    for target in targets:
                        self._bind(target, result, scope)
                case ast.AnnAssign(target=target, value=ast.expr() as value):
                    self._bind(target, self._assigned(value, scope, target), scope)
                case ast.AugAssign(target=ast.Name(id=name), op=op, value=value):
                    pair = scope.get(name, Unknown(f"{name!r} is not defined")), self.value(value, scope)
                    scope[name] = self._computed(op, *pair)
                case ast.Expr(value=value):
                    self._assigned(value, scope, None)
                case ast.FunctionDef(name=name):
                    scope[name] = UserFunction(statement, scope)
                case ast.Return(value=value):
                    raise _Returned(None if value is None else self.value(value, scope))
                case ast.If(test=test, body=body, orelse=orelse):
                    holds = self.value(test, scope)
                    if isinstance(holds, Unknown):
                        self._leave(statement, f"a condition: {holds.why}")
                    else:
                        self.run(body if holds else orelse, scope)
                case ast.For(target=target, iter=iterable, body=body):
                    values = self.value(iterable, scope)
                    if isinstance(values, list | tuple | range | enumerate | zip | dict):
                        for item in values:
                            self._bind(target, item, scope)
                            self.run(body, scope)
                    else:
                        why = values.why if isinstance(values, Unknown) else "this is no list"
                        self._leave(statement, f"a loop: {why}")
                case ast.Try():
                    # It may end with an error, as tests provoke some.  What it makes is not known then, and what needs
                    # that is refused; what it changes would be lost.
                    changes = any(isinstance(node, ast.keyword) and node.arg == "reuse" for node in ast.walk(statement))
                    self._leave(statement, "try is not evaluated", alone=not changes)
                case ast.Import() | ast.ImportFrom() | ast.Pass() | ast.Delete() | ast.Global() | ast.Assert():
                    pass
                case _:
                    self._leave(statement, f"{type(statement).__name__.lower()} is not evaluated")

    def _leave(self, statement: ast.stmt, why: str, *, alone: bool = False) -> None:
        """Do not evaluate a statement; it matters if a command is in it, or what it assigns is needed, and if it stands
        ``alone`` only that.
        """
        names = set() if alone else {name for node in ast.walk(statement) if (name := _command_name(node))} - {"_F"}
        self.content.unread.append((statement.lineno, f"{why}; in it: {', '.join(sorted(names)) or 'no command'}"))
        for node in ast.walk(statement):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                self.variables[node.id] = Unknown(f"{node.id!r} is of line {statement.lineno}: {why}")

    def _bind(self, target: ast.expr, value: Any, scope: dict[str, Any]) -> None:
        match target:
            case ast.Name(id=name):
                scope[name] = value
            case ast.Tuple(elts=parts) | ast.List(elts=parts):
                values = value if isinstance(value, tuple | list) and len(value) == len(parts) else None
                for k, part in enumerate(parts):
                    self._bind(
                        part, Unknown("it is not one value for each name") if values is None else values[k], scope
                    )
            case ast.Subscript(value=ast.Name(id=name), slice=key):
                holder, at = scope.get(name), self.value(key, scope)
                try:
                    if isinstance(holder, list | dict):
                        holder[at] = value
                except (TypeError, IndexError, KeyError):
                    scope[name] = Unknown(f"an entry of {name!r}")

    def _assigned(self, node: ast.expr, scope: dict[str, Any], target: ast.expr | None) -> Any:
        if isinstance(node, ast.Call) and _command_name(node) and not self._is_function(node, scope):
            name = target.id if isinstance(target, ast.Name) else ast.unparse(target) if target is not None else ""
            return self._command(node, scope, name)
        return self.value(node, scope)

    def _is_function(self, node: ast.Call, scope: dict[str, Any]) -> bool:
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        return name == "_F" or isinstance(scope.get(name, self.variables.get(name)), UserFunction)

    def _command(self, node: ast.Call, scope: dict[str, Any], name: str) -> Concept:
        assert isinstance(node.func, ast.Name)
        command = AsterCommand(node.func.id, self._keywords(node, scope), node.lineno)
        self.content.commands.append(command)
        changed = command.keywords.get("reuse")
        if isinstance(changed, Concept):
            changed.commands.append(command)
            return changed
        concept = Concept(name, [command])
        self.content.concepts.append(concept)
        return concept

    def _keywords(self, node: ast.Call, scope: dict[str, Any]) -> dict[str, Any]:
        keywords: dict[str, Any] = {}
        for keyword in node.keywords:
            value = self._assigned(keyword.value, scope, None)
            if keyword.arg is not None:
                keywords[keyword.arg] = value
            elif isinstance(value, dict):
                keywords |= value
            else:
                keywords["**"] = value if isinstance(value, Unknown) else Unknown("** of what is no dictionary")
        return keywords

    # --- terms --------------------------------------------------------------------------------------------------------

    def value(self, node: ast.expr, scope: dict[str, Any]) -> Any:
        """The value of a term, ``Unknown`` where it is not evaluated."""
        self._count(node)
        match node:
            case ast.Constant(value=value):
                return value
            case ast.Name(id=name):
                for variables in (scope, self.variables, _CONSTANTS):
                    if name in variables:
                        return variables[name]
                return Unknown(f"{name!r} is not defined")
            case ast.Tuple(elts=parts):
                return tuple(self._parts(parts, scope))
            case ast.List(elts=parts):
                return self._parts(parts, scope)
            case ast.Dict(keys=keys, values=values) if None not in keys:
                labels = [self.value(key, scope) for key in keys if key is not None]
                if all(isinstance(label, str | int | float) for label in labels):
                    return dict(zip(labels, (self._assigned(value, scope, None) for value in values), strict=True))
            case ast.BinOp(left=first, op=op, right=right):
                return self._computed(op, self.value(first, scope), self.value(right, scope))
            case ast.UnaryOp(op=op, operand=operand):
                return self._computed(op, self.value(operand, scope))
            case ast.Compare(left=first, ops=[op], comparators=[right]):
                return self._computed(op, self.value(first, scope), self.value(right, scope))
            case ast.BoolOp(op=op, values=values):
                results = [self.value(value, scope) for value in values]
                missing = next((result for result in results if isinstance(result, Unknown)), None)
                return missing or (all(results) if isinstance(op, ast.And) else any(results))
            case ast.IfExp(test=test, body=body, orelse=orelse):
                holds = self.value(test, scope)
                return holds if isinstance(holds, Unknown) else self.value(body if holds else orelse, scope)
            case ast.Subscript(value=holder, slice=ast.expr() as key) if not isinstance(key, ast.Slice):
                pair = self.value(holder, scope), self.value(key, scope)
                missing = next((part for part in pair if isinstance(part, Unknown)), None)
                try:
                    return missing or (pair[0][pair[1]] if isinstance(pair[0], list | tuple | dict | range) else None)
                except (TypeError, IndexError, KeyError):
                    return Unknown(f"there is no {ast.unparse(node)}")
            case ast.Attribute(value=ast.Name(), attr=name) if name in _CONSTANTS:
                return _CONSTANTS[name]
            case ast.ListComp(elt=part, generators=[ast.comprehension(target=target, iter=iterable, ifs=[])]):
                listed = self.value(iterable, scope)
                if isinstance(listed, list | tuple | range):
                    inner = dict(scope)
                    results = []
                    for item in listed:
                        self._bind(target, item, inner)
                        results.append(self._assigned(part, inner, None))
                    return results
            case ast.Call():
                return self._called(node, scope)
            case ast.Lambda():
                return UserFunction(node, scope)
        return Unknown(f"{ast.unparse(node)[:60]!r} is not evaluated")

    def _parts(self, parts: list[ast.expr], scope: dict[str, Any]) -> list[Any]:
        return [self._assigned(part, scope, None) for part in parts]

    def _computed(self, op: ast.AST, *operands: Any) -> Any:
        for operand in operands:
            if isinstance(operand, Unknown):
                return operand
        function = _ARITHMETIC.get(type(op))
        numbers = all(isinstance(operand, int | float) for operand in operands)
        if function is None or not (numbers or isinstance(op, ast.Add | ast.cmpop | ast.Mod | ast.Not)):
            if isinstance(op, ast.Mult) and _short(operands):
                return operands[0] * operands[1]
            return Unknown("an operation that is not evaluated")
        if isinstance(op, ast.Pow):
            operands = tuple(map(float, operands))
        if isinstance(op, ast.Mod) and not numbers:
            text = operands[0]
            if not isinstance(text, str) or re.search(r"%[^a-zA-Z%]*(\d{3}|\*)", text):  # or as wide as it says
                return Unknown("an operation that is not evaluated")
        try:
            result = function(*operands)
        except (ArithmeticError, TypeError, ValueError) as error:
            return Unknown(f"a term has no value: {error}")
        if isinstance(result, complex) or (isinstance(result, str | list | tuple) and len(result) > _LONGEST):
            return Unknown("a term that is too long, or no real number")
        return result

    def _called(self, node: ast.Call, scope: dict[str, Any]) -> Any:
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if isinstance(node.func, ast.Name):
            if name == "_F":
                return self._keywords(node, scope)
            function = scope.get(name, self.variables.get(name))
            if isinstance(function, UserFunction):
                return self._user(function, [self.value(part, scope) for part in node.args])
            if isinstance(function, Concept):
                arguments = [self.value(part, scope) for part in node.args]
                missing = next((part for part in arguments if isinstance(part, Unknown)), None)
                return missing or self.function(function, dict(zip(_parameters(function), arguments, strict=False)))
            if _command_name(node):
                return self._command(node, scope, "")
        holder = node.func.value if isinstance(node.func, ast.Attribute) else None
        if name == "append" and isinstance(holder, ast.Name) and isinstance(scope.get(holder.id), list) and node.args:
            scope[holder.id].append(self._assigned(node.args[0], scope, None))
            return None
        plain = holder is None or (isinstance(holder, ast.Name) and holder.id in ("math", "np", "numpy", "NP"))
        if name in _FUNCTIONS and plain and not node.keywords:
            arguments = [self.value(part, scope) for part in node.args]
            missing = next((part for part in arguments if isinstance(part, Unknown)), None)
            if missing is not None:
                return missing
            try:
                result = _FUNCTIONS[name](*arguments)
                if isinstance(result, range) and len(result) > _LONGEST:
                    return Unknown("a range that is too long")
                return list(result) if isinstance(result, enumerate | zip) else result
            except (ArithmeticError, TypeError, ValueError) as error:
                return Unknown(f"{name}: {error}")
        return Unknown(f"{ast.unparse(node)[:60]!r} is not evaluated")

    def _user(self, function: UserFunction, arguments: list[Any]) -> Any:
        names = [argument.arg for argument in function.node.args.args]
        if len(names) != len(arguments) or self._depth >= _DEEPEST:
            return Unknown("a function with other arguments, or that calls itself too often")
        inner = dict(function.scope) | dict(zip(names, arguments, strict=True))
        self._depth += 1
        try:
            if isinstance(function.node, ast.Lambda):
                return self.value(function.node.body, inner)
            self.run(function.node.body, inner)
        except _Returned as returned:
            return returned.value
        finally:
            self._depth -= 1
        return None

    def function(self, concept: Concept, parameters: Parameters) -> Any:
        """The value of a function of the command file: FORMULE, DEFI_FONCTION, DEFI_CONSTANTE."""
        command = concept.made_by
        match command.name:
            case "DEFI_CONSTANTE":
                return command.number(command.get("VALE"), "VALE")
            case "DEFI_FONCTION":
                (name,) = command.words(command.get("NOM_PARA"), "NOM_PARA")[:1]
                if name not in parameters:
                    raise CommandError(command.origin, f"a function of {name} is not known here")
                return interpolated(command, parameters[name])
            case "FORMULE":
                text = command.words(command.get("VALE"), "VALE")[0]
                try:
                    term = ast.parse(" ".join(text.split()), mode="eval").body
                except (SyntaxError, ValueError, RecursionError):
                    raise CommandError(command.origin, f"VALE: {text!r} is no term") from None
                settings = {key: value for key, value in command.keywords.items() if key not in ("VALE", "NOM_PARA")}
                value = self.value(term, {**self.variables, **settings, **parameters})
                if isinstance(value, Unknown):
                    raise CommandError(command.origin, f"VALE: {value.why}")
                return value
        raise CommandError(command.origin, "this is no function that is known")

    def _count(self, node: ast.AST) -> None:
        self._evaluated += 1
        if self._evaluated > _MOST_EVALUATED:
            line = getattr(node, "lineno", 0)
            raise CommandError(f"line {line}", f"more than {_MOST_EVALUATED} terms: a loop without end?")


def value_at(value: Any, parameters: Parameters, command: AsterCommand, key: str) -> float:
    """A number, or a function at some coordinates and an instant.

    Args:
        value: of a keyword.
        parameters: X, Y, Z and INST.
        command: that has it.
        key: its keyword.

    Raises:
        CommandError: it has no value there.
    """
    if isinstance(value, Concept):
        value = _CommandReader().function(value, parameters)
    return command.number(value, key)


def depends_on(value: Any) -> set[str]:
    """The parameters of a function, empty for a number."""
    return set(_parameters(value)) if isinstance(value, Concept) else set()


def _parameters(concept: Concept) -> list[str]:
    if concept.made_by.name == "DEFI_CONSTANTE":
        return []
    names = concept.made_by.keywords.get("NOM_PARA", ())
    return [str(name) for name in (names if isinstance(names, tuple | list) else (names,))]


def _command_name(node: ast.AST) -> str:
    """The name of what a term calls, if it is in capitals as those of commands are; "": it is not, or calls nothing."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id.isupper():
        return node.func.id
    return ""


def _short(operands: tuple[Any, ...]) -> bool:
    """Whether a list times a number is short enough."""
    pairs = (operands, operands[::-1])
    return any(
        isinstance(a, list | tuple) and isinstance(n, int) and not isinstance(n, bool) and len(a) * n <= _LONGEST
        for a, n in pairs
    )
