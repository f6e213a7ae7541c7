"""From text to a syntax tree of few, known kinds of nodes; nothing is ever executed."""

from __future__ import annotations

import ast
import re
import warnings

from nathlon.sim.errors import InputError

LONGEST = 2000
"""Characters of an expression."""
MOST_NODES, DEEPEST = 1000, 100
FOREIGN = re.compile(r"[^A-Za-z0-9_.+\-*/()<>=!, \n]")
"""What no expression holds: no strings, brackets, comments or lambdas."""

OPERATORS = (
    *(ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow),
    *(ast.USub, ast.UAdd, ast.Not, ast.And, ast.Or),
    *(ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq),
)
NODES = (
    ast.BinOp,
    ast.UnaryOp,
    ast.BoolOp,
    ast.Compare,
    ast.IfExp,
    ast.Call,
    ast.Name,
    ast.Constant,
    ast.Load,
)


def fault(node: ast.AST, sentence: str) -> InputError:
    """An error at a node: the sentence after its column."""
    column = getattr(node, "col_offset", 0) + 1
    return InputError(f"column {column}: {sentence}")


def parse_text(text: str) -> ast.expr:
    """The syntax tree of an expression.

    Raises:
        InputError: if the text is none; with the column, counted from 1 through all lines.
    """
    if len(text) > LONGEST:
        raise InputError(f"an expression of {len(text)} characters, expected at most {LONGEST}")
    if not text.strip():
        raise InputError("column 1: nothing there, expected an expression")
    if foreign := FOREIGN.search(text):
        hint = " (a power is **)" if foreign[0] == "^" else ""
        raise InputError(
            f"column {foreign.start() + 1}: {foreign[0]!r} means nothing here, "
            f"expected names, numbers, operators and parentheses{hint}"
        )
    line = text.replace("\n", " ")
    start = len(line) - len(line.lstrip())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = ast.parse(line[start:], mode="eval").body
    except SyntaxError as error:
        column = start + min(error.offset or 1, len(line) - start + 1)
        raise InputError(f"column {column}: no expression can go on here ({error.msg})") from None
    except (MemoryError, RecursionError, ValueError):
        raise InputError("an expression nested so deep that it cannot be read") from None
    for node in ast.walk(tree):
        if hasattr(node, "col_offset"):
            node.col_offset += start
    _check(tree)
    return tree


def _check(tree: ast.expr) -> None:
    """Raise an InputError for a tree that is too large, or has nodes of other kinds."""
    nodes = depth = 0
    # Operators have no column of their own: theirs is that of what they belong to.
    level: list[tuple[ast.AST, ast.AST]] = [(tree, tree)]
    while level:
        for node, above in level:
            if not isinstance(node, NODES + OPERATORS):
                place = node if hasattr(node, "col_offset") else above
                raise fault(place, f"{_words(node)} is not part of the language")
        nodes, depth = nodes + len(level), depth + 1
        if nodes > MOST_NODES or depth > DEEPEST:
            raise fault(level[0][1], f"expected at most {MOST_NODES} parts, nested at most {DEEPEST} deep")
        level = [(child, node) for node, _ in level for child in ast.iter_child_nodes(node)]


def _words(node: ast.AST) -> str:
    name = type(node).__name__
    known = {"FloorDiv": "//", "Tuple": "a list with commas", "Attribute": "a name after a dot"}
    return known.get(name, re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower())
