"""Finds a piece of code by its syntax and replaces it, whatever the layout, comments and code around it."""

from __future__ import annotations

import ast
import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from textwrap import dedent, indent

Node = ast.expr | ast.keyword | ast.stmt
_SCOPES = (ast.FunctionDef, ast.ClassDef)


@dataclass(frozen=True)
class Piece:
    """One or several neighbouring syntax nodes.

    Attributes:
        scope: qualified name of the function or class that it stands in, "" at the top of the module.
        nodes: the nodes, in order.
    """

    scope: str
    nodes: tuple[Node, ...]


def parse(text: str) -> tuple[Node, ...]:
    """An expression, a keyword argument ``name=value`` (no spaces around the sign), or statements.

    Raises:
        SyntaxError: the text is none of them.
    """
    with contextlib.suppress(SyntaxError):
        return (ast.parse(text, mode="eval").body,)
    if " = " not in text:
        with contextlib.suppress(SyntaxError):
            call = ast.parse(f"_({text})", mode="eval").body
            if isinstance(call, ast.Call) and not call.args and len(call.keywords) == 1:
                return tuple(call.keywords)
    return tuple(ast.parse(dedent(text)).body)


def find(tree: ast.Module, text: str, scope: str = "", *, statements: bool = False) -> list[Piece]:
    """All places of a module with the syntax of ``text``.

    Args:
        tree: the module.
        text: see ``parse``.
        scope: qualified name of the function or class to look in, "": the whole module.
        statements: whether an expression is meant as a statement of its own.
    """
    wanted = tuple(ast.parse(dedent(text)).body) if statements else parse(text)
    dumps = [ast.dump(node) for node in wanted]
    kinds = [type(node) for node in wanted]
    return [
        Piece(where, found)
        for where, found in _all_runs(tree, len(wanted))
        if f"{where}.".startswith(f"{scope}." if scope else "")
        and [type(node) for node in found] == kinds
        and [ast.dump(node) for node in found] == dumps
    ]


def replace(source: str, piece: Piece, new: str) -> str:
    """The source of a module with ``new`` in the place of a piece."""
    first, last = piece.nodes[0], piece.nodes[-1]
    lines = source.encode().splitlines(keepends=True)  # columns count bytes
    begin = sum(map(len, lines[: first.lineno - 1])) + first.col_offset
    assert last.end_lineno is not None
    assert last.end_col_offset is not None
    end = sum(map(len, lines[: last.end_lineno - 1])) + last.end_col_offset
    if isinstance(first, ast.stmt):
        new = indent(dedent(new).strip("\n"), " " * first.col_offset)[first.col_offset :]
    elif isinstance(first, ast.expr):
        new = f"({new})"
    data = source.encode()
    return (data[:begin] + new.encode() + data[end:]).decode()


# The mistakes in one module follow each other.
@lru_cache(maxsize=2)
def tree_of(source: str) -> ast.Module:
    """The syntax of a module, which is not to be changed."""
    return ast.parse(source)


@lru_cache(maxsize=4)
def _all_runs(tree: ast.Module, length: int) -> tuple[tuple[str, tuple[Node, ...]], ...]:
    return tuple(_runs(tree, "", length))


def _runs(node: ast.AST, scope: str, length: int) -> Iterator[tuple[str, tuple[Node, ...]]]:
    """All expressions and keyword arguments, and all runs of neighbouring statements, below a node."""
    for _, value in ast.iter_fields(node):
        children = value if isinstance(value, list) else [value]
        for place, child in enumerate(children):
            if isinstance(child, ast.stmt):
                yield scope, tuple(children[place : place + length])
            elif isinstance(child, ast.expr | ast.keyword):
                yield scope, (child,)
            if isinstance(child, ast.AST):
                name = f"{scope}.{child.name}".lstrip(".") if isinstance(child, _SCOPES) else scope
                yield from _runs(child, name, length)


def needs(text: str) -> set[str]:
    """The names that a piece of code reads and does not set itself."""
    nodes = [node for part in parse(text) for node in ast.walk(part)]
    read = {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)}
    own = {node.id for node in nodes if isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load)}
    return read - own - {node.arg for node in nodes if isinstance(node, ast.arg)}


@lru_cache(maxsize=2)
def names(source: str) -> frozenset[str]:
    """The names that a module sets, defines or imports anywhere."""
    found: set[str] = set()
    for node in ast.walk(tree_of(source)):
        match node:
            case ast.Name(id=name, ctx=ast.Store()) | ast.arg(arg=name):
                found.add(name)
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                found.add(name)
            case ast.Import(names=aliases) | ast.ImportFrom(names=aliases):
                found |= {(alias.asname or alias.name).partition(".")[0] for alias in aliases}
            case ast.MatchAs(name=str(name)):
                found.add(name)
    return frozenset(found)
