"""Names of mutants that outlive a refactoring, and the list of those that survive.

They say the operator, never the source that it changed:

    comparison < -> <= #2       the second `<` of the function that became `<=`

A name changes only where the function gets more or fewer places of the same operator.
"""

import ast
import io
import tokenize
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

KINDS = {
    "comparison": ("<", "<=", ">", ">=", "==", "!="),
    "arithmetic": ("+", "-", "*", "/", "//", "%", "**", "<<", ">>", "&", "|", "^"),
    "boolean": ("and", "or", "True", "False"),
}
Place = tuple[int, int]  # line and column


def explained(survivors: Path) -> dict[str, str]:
    """Return name -> reason of a file: names, a line each, and under them, indented, the reason.

    Raises:
        SystemExit: names without a reason, a reason without names, or a name twice.
    """
    entries: dict[str, str] = {}
    for block in survivors.read_text().split("\n\n"):
        lines = [line for line in block.splitlines() if not line.startswith("#")]
        names = [line for line in lines if not line[:1].isspace()]
        reason = " ".join(line.strip() for line in lines[len(names) :])
        if lines and not (names and reason):
            raise SystemExit(f"{survivors.name}: no name or no reason:\n{block}")
        for name in names:
            if name in entries:
                raise SystemExit(f"{survivors.name}: stands there twice: {name}")
            entries[name] = reason
    return entries


def numbered(changes: Iterable[tuple[str, str]]) -> list[str]:
    """Name a function's mutants, each (source before, after); they are numbered by place."""
    placed = [operator(*change) for change in changes]
    seen: Counter[str] = Counter()
    names = [""] * len(placed)
    for index in sorted(range(len(placed)), key=lambda i: placed[i][1]):
        text = placed[index][0]
        seen[text] += 1
        names[index] = f"{text} #{seen[text]}"
    return names


def operator(before: str, after: str) -> tuple[str, Place]:
    """Name the change of a function; return the name and its place in the source."""
    old, new = tokens(before), tokens(after)
    changed = [pair for pair in zip(old, new, strict=False) if pair[0].string != pair[1].string]
    place = changed[0][0].start if changed else old[-1].start
    if len(old) == len(new) and len(changed) == 1:
        one, other = changed[0]
        inside = one.type == tokenize.STRING and "f" in one.string.partition(one.string[-1])[0]
        if not inside and other.string not in ("None", "pass"):
            return of_token(one, other), place
    return of_node(*difference(ast.parse(before), ast.parse(after), None)), place


def tokens(source: str) -> list[tokenize.TokenInfo]:
    """Return the tokens of a source without comments, line ends and indents."""
    spaces = (tokenize.NL, tokenize.COMMENT, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)
    read = tokenize.generate_tokens(io.StringIO(source).readline)
    return [token for token in read if token.type not in spaces]


def of_token(old: tokenize.TokenInfo, new: tokenize.TokenInfo) -> str:
    """Name the exchange of one token. A text is not quoted: words may change."""
    if old.type == tokenize.STRING:
        upper = {"upper case": str.upper, "lower case": str.lower}
        return "text -> " + next(
            (how for how, case in upper.items() if new.string == case(old.string)), "XXtextXX"
        )
    if new.type == tokenize.STRING:
        return f"value {old.string} -> text"
    if old.type == tokenize.NUMBER:
        return f"number {old.string} -> {new.string}"
    if old.string.endswith("=") and old.string not in KINDS["comparison"]:
        return f"assignment {old.string} -> {new.string}"
    kind = next((kind for kind, words in KINDS.items() if old.string in words), "word")
    return f"{kind} {old.string} -> {new.string}"


def same(one: object, other: object) -> bool:
    """Return whether two pieces of syntax, lists or values are the same, wherever they stand."""
    if isinstance(one, ast.AST) and isinstance(other, ast.AST):
        return ast.dump(one) == ast.dump(other)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    return one == other


def difference(
    old: ast.AST, new: ast.AST, parent: ast.AST | None
) -> tuple[ast.AST, ast.AST, ast.AST | None]:
    """Return the smallest piece that differs, old and new, and the old piece that holds it."""
    if type(old) is not type(new):
        return old, new, parent
    differing: list[tuple[object, object]] = []
    for field in old._fields:
        one, other = getattr(old, field), getattr(new, field)
        if isinstance(one, list) and len(one) == len(other):
            pairs = zip(one, other, strict=True)
            differing += [pair for pair in pairs if not same(*pair)]
        elif not same(one, other):
            differing.append((one, other))
    if len(differing) == 1:
        one, other = differing[0]
        if isinstance(one, ast.AST) and isinstance(other, ast.AST):
            return difference(one, other, old)
    return old, new, parent


def of_node(old: ast.AST, new: ast.AST, parent: ast.AST | None) -> str:  # noqa: PLR0911
    """Name a change of more than one token; ``parent`` is the old piece that holds ``old``."""
    match old, new:
        case ast.UnaryOp(op=ast.Not() | ast.Invert(), operand=inner), _ if same(inner, new):
            return "not left out"
        case _, ast.UnaryOp(op=ast.Not(), operand=inner) if same(inner, old):
            return "condition negated"
        case _, ast.BoolOp(op=op, values=[inner, ast.Constant(value=bool(value))]) if same(
            inner, old
        ):
            return f"condition {'and' if isinstance(op, ast.And) else 'or'} {value}"
        case ((ast.Is() | ast.IsNot() | ast.In() | ast.NotIn()), ast.cmpop()):
            words = {ast.Is: "is", ast.IsNot: "is not", ast.In: "in", ast.NotIn: "not in"}
            return f"comparison {words[type(old)]} -> {words[type(new)]}"
        case ast.operator(), ast.operator():
            x = ast.Name("x")
            one, other = (ast.unparse(ast.BinOp(x, op, x))[2:-2] for op in (old, new))
            return f"arithmetic {one} -> {other}"
        case ast.Constant(value=int() | float()), ast.Constant(value=int() | float()):
            return f"number {old.value} -> {new.value}"
        case _, ast.Pass():
            return f"{'call' if isinstance(old, ast.Expr) else type(old).__name__.lower()} left out"
        case ast.Match(), ast.Match():
            return f"case {1 + left_out(old.cases, new.cases)} left out"
        case ast.Call(), ast.Call():
            return f"argument {argument(old, new)} left out"
        case _, ast.Constant(value=None):
            return f"{holder(old, parent)} -> None"
    return f"{type(old).__name__.lower()} -> {type(new).__name__.lower()}"


def holder(old: ast.AST, parent: ast.AST | None) -> str:
    """Name the argument, lambda or value that became None."""
    match parent:
        case ast.keyword(arg=name):
            return f"argument {name}"
        case ast.Call(args=args) if any(old is arg for arg in args):
            return f"argument {1 + next(i for i, arg in enumerate(args) if arg is old)}"
        case ast.Lambda():
            return "lambda"
    plain = isinstance(old, ast.Constant) and not isinstance(old.value, str | bytes)
    return f"value {ast.unparse(old)}" if plain else "value"


def left_out(old: list[ast.AST], new: list[ast.AST]) -> int:
    """Return the index of the element that a shorter list lacks."""
    pairs = enumerate(zip(old, new, strict=False))
    return next((i for i, (one, other) in pairs if not same(one, other)), len(new))


def argument(old: ast.Call, new: ast.Call) -> str:
    """Return the keyword that a call lacks, or the place (from 1) of a positional argument."""
    if len(old.args) > len(new.args):
        return str(1 + left_out(list(old.args), list(new.args)))
    if len(old.keywords) > len(new.keywords):
        return old.keywords[left_out(list(old.keywords), list(new.keywords))].arg or "**"
    return "key"
