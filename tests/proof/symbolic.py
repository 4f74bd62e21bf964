"""Runs functions of the gate on every path, with unknown numbers in the place of floats and bits.

It is their own code that runs: where it branches on an unknown, z3 says which ways are possible,
and each of them is run. Numbers are exact: reals, integers, or bits of a frame.
"""

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import z3


class Paths:
    """All paths of a function.

    Args:
        assumed: what holds at its begin.

    Attributes:
        count: paths so far.
    """

    current: "Paths"

    def __init__(self, *assumed: "Unknown") -> None:
        self._solver = z3.Solver()
        self._solver.add(*(one.of for one in assumed))
        self.count = 0
        self._taken: list[bool] = []
        self._at = 0
        self._here: list[Any] = []
        self._pending: list[list[bool]] = [[]]

    def prove(self, run: Callable[[], "Unknown | bool"]) -> None:
        """Prove that the returned claim holds on every path.

        Raises:
            AssertionError: with numbers for which it does not.
        """
        Paths.current = self
        while self._pending:
            self._taken, self._at, self._here = self._pending.pop(), 0, []
            claim = value(run())
            self.count += 1
            answer = self._solver.check(*self._here, z3.Not(claim))
            assert answer != z3.unknown, "not decided"
            assert answer == z3.unsat, self._solver.model()

    def decide(self, condition: Any) -> bool:
        """Which way this path goes; the other one, where it is possible, is for later."""
        if self._at == len(self._taken):
            ways = [way for way in (True, False) if self._possible(condition, way)]
            if len(ways) == 2:
                self._pending.append([*self._taken, False])
            self._taken.append(ways[0])
        way = self._taken[self._at]
        self._at += 1
        self._here.append(condition if way else z3.Not(condition))
        return way

    def _possible(self, condition: Any, way: bool) -> bool:
        answer = self._solver.check(*self._here, condition if way else z3.Not(condition))
        assert answer != z3.unknown, "not decided"
        return bool(answer == z3.sat)


def value(one: Any) -> Any:
    """For z3: a float is exactly the fraction that it is."""
    if isinstance(one, Unknown):
        return one.of
    return z3.RealVal(str(Fraction(one))) if isinstance(one, float) else one


class Unknown:
    """A number or a condition, with the operators that the rules use."""

    __hash__ = None  # type: ignore[assignment]

    def __init__(self, of: Any) -> None:
        self.of = of

    def __bool__(self) -> bool:
        return Paths.current.decide(self.of if z3.is_bool(self.of) else self.of != 0)

    def __abs__(self) -> "Unknown":
        return self if self >= 0 else -self

    def __neg__(self) -> "Unknown":
        return Unknown(-self.of)

    def __format__(self, _: str) -> str:
        return "unknown"

    def __invert__(self) -> "Unknown":
        return Unknown(~self.of)

    def __rsub__(self, other: Any) -> "Unknown":
        return Unknown(value(other) - self.of)

    def __rtruediv__(self, other: Any) -> "Unknown":
        return Unknown(value(other) / self.of)

    def __radd__(self, other: Any) -> "Unknown":
        number = z3.If(self.of, 1, 0) if z3.is_bool(self.of) else self.of
        return Unknown(value(other) + number)


def _operator(name: str) -> Callable[[Unknown, Any], Unknown]:
    def apply(self: Unknown, other: Any) -> Unknown:
        return Unknown(getattr(self.of, name)(value(other)))

    return apply


for _name in "add sub mul truediv lt le gt ge eq ne and xor rshift rmul".split():  # noqa: SIM905
    setattr(Unknown, f"__{_name}__", _operator(f"__{_name}__"))


def real(name: str) -> Any:
    return Unknown(z3.Real(name))


def integer(name: str) -> Any:
    return Unknown(z3.Int(name))


def truth(name: str) -> Any:
    return Unknown(z3.Bool(name))


def implies(when: Any, then: Any) -> Unknown:
    return Unknown(z3.Implies(value(when), value(then)))


def both(*claims: Any) -> Unknown:
    return Unknown(z3.And(*map(value, claims)))


def either(*claims: Any) -> Unknown:
    return Unknown(z3.Or(*map(value, claims)))


def no(claim: Any) -> Unknown:
    return Unknown(z3.Not(value(claim)))


def most(first: Any, *others: Any) -> Any:
    """The largest."""
    for other in others:
        a, b = value(first), value(other)
        first = Unknown(z3.If(a >= b, a, b))
    return first


def size(one: Any) -> Any:
    return most(one, -one)
