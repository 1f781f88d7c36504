"""Formulas of time as programs write them, such as 2.0d*pi*time, made functions without running any of their text"""

import ast
import operator
import re
from collections.abc import Callable

import numpy as np

from .._tools._numbers import Numeric, xp

_OPERATORS: dict[type, Callable[..., Numeric]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
FUNCTIONS: dict[str, Callable[[Numeric], Numeric]] = {
    "sin": xp.sin,
    "cos": xp.cos,
    "tan": xp.tan,
    "arcsin": xp.arcsin,
    "arccos": xp.arccos,
    "arctan": xp.arctan,
    "asin": xp.arcsin,
    "acos": xp.arccos,
    "atan": xp.arctan,
    "exp": xp.exp,
    "ln": xp.log,
    "log": xp.log10,
    "sqrt": xp.sqrt,
    "abs": xp.abs,
}
_LONGEST = 2000  # characters


def law_of(text: str) -> Callable[[Numeric], Numeric] | None:
    """The function of time of a formula; None of a text that is none. What stands in double quotes is a comment, and
    <n> the end of a line."""
    plain = re.sub(r'"[^"]*"|<n>', " ", text)
    plain = re.sub(r"(?<![\w.])(\d+\.?\d*|\.\d+)[dD](?![\w.+-])", r"\1", plain)  # a number of double precision
    plain = re.sub(r"(?<![\w.])(\d+\.?\d*|\.\d+)[dD](?=[+-]?\d)", r"\1e", plain).replace("^", "**").strip()
    if len(plain) > _LONGEST:
        return None
    try:
        tree = ast.parse(plain, mode="eval").body
        with np.errstate(all="ignore"):
            if not _is_formula(tree) or not np.isfinite(float(_value(tree, 1.0))):
                return None
    except (SyntaxError, RecursionError, MemoryError, ArithmeticError, ValueError):
        return None
    return lambda t: _value(tree, t)


def _is_formula(node: ast.AST) -> bool:
    match node:
        case ast.Constant(value=value):
            return isinstance(value, int | float) and not isinstance(value, bool)
        case ast.Name(id=name):
            return name in ("time", "pi")
        case ast.BinOp(left=left, op=op, right=right):
            return type(op) in _OPERATORS and _is_formula(left) and _is_formula(right)
        case ast.UnaryOp(op=op, operand=operand):
            return type(op) in _OPERATORS and _is_formula(operand)
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]):
            return name in FUNCTIONS and _is_formula(argument)
    return False


def _value(node: ast.AST, t: Numeric) -> Numeric:
    """Of a node that is of a formula."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return float(value)
        case ast.Name(id=name):
            return t if name == "time" else np.pi
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATORS[type(op)](_value(left, t), _value(right, t))
        case ast.UnaryOp(op=op, operand=operand):
            return _OPERATORS[type(op)](_value(operand, t))
        case ast.Call(func=ast.Name(id=name), args=[argument]):
            return FUNCTIONS[name](_value(argument, t))
    return np.nan
