"""The state of a controller as bytes, and back: a replay begins with it.

``pickle`` saves by value every object that the controller refers to, except for objects that never
change: configuration, messages of the DBC files and their layouts, functions. The state contains a
number for each of these, and the replay takes the object of that number from its own deployment.

Anybody may have made a black box, and a pickle can call any function that it names. This loader
accepts only classes of the packages that a controller consists of, none of which touches a file or
a process, and only the opcodes that they need.
"""

import io
import pickle
import pickletools
import sys
from collections.abc import Callable, Iterator
from copyreg import __newobj__  # type: ignore[attr-defined]
from opcode import opmap
from pathlib import PurePath
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

from cantools.database.can import Message
from pydantic import BaseModel

from canshaper.codec.layout import Layout
from canshaper.codec.message import FieldSet
from canshaper.codec.velocity import FlaggedVelocity
from canshaper.config.source import Source
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.errors import StateError
from canshaper.machine.database import Messages

# Classes whose objects never change: the content of a deployment file and its DBC files.
FIXED = (
    BaseModel,
    Message,
    Messages,
    Layout,
    FieldSet,
    FlaggedVelocity,
    Source,
    PurePath,
    FunctionType,
    BuiltinFunctionType,
)
PROTOCOL = 5
MISSING = object()
STORE_ATTR = opmap["STORE_ATTR"]
_ATTRIBUTES: dict[type, tuple[str, ...]] = {}  # by class, see ``attributes``
OPCODES = frozenset(
    "PROTO FRAME STOP MARK POP POP_MARK MEMOIZE BINGET LONG_BINGET NONE NEWTRUE NEWFALSE BININT"  # noqa: SIM905
    " BININT1 BININT2 LONG1 BINFLOAT SHORT_BINUNICODE BINUNICODE SHORT_BINBYTES BINBYTES"
    " EMPTY_TUPLE TUPLE TUPLE1 TUPLE2 TUPLE3 EMPTY_LIST APPEND APPENDS EMPTY_DICT SETITEM SETITEMS"
    " EMPTY_SET ADDITEMS FROZENSET STACK_GLOBAL NEWOBJ REDUCE BUILD".split()
)
Root = tuple[GatedController, Controller]


def _fixed(number: int) -> Any:
    """Represent in a pickle an object that never changes, by its number."""
    raise NotImplementedError  # only its name is used


def _method(one: Any, name: str) -> Any:
    """Represent in a pickle a method of one of our objects; loading it returns the method."""
    if type(one).__module__ == "builtins" or name.startswith("__"):
        raise StateError(
            f"expected a method of an object of ours, got {name} of {type(one).__name__}"
        )
    return MethodType(getattr(type(one), name), one)


class States:
    """Saves the state of a controller, and makes controllers from saved states.

    Args:
        gated: a new controller behind its gate.
        controller: that controller.

    Raises:
        StateError: an object in it cannot be saved.
    """

    def __init__(self, gated: GatedController, controller: Controller) -> None:
        self._root: Root = (gated, controller)
        self._numbers: dict[int, int] = {}
        self._fixed: list[Any] = []  # kept alive, so that no other object gets their ids
        self._classes: set[type] = set()
        self._numbering = True
        self.save()
        self._numbering = False
        packages = {kind.__module__.rpartition(".")[0] for kind in self._classes}
        self._packages = {name for name in packages if name.startswith("canshaper.")}

    def save(self) -> bytes:
        """Return the present state of the controller as bytes.

        Raises:
            StateError: an object in it cannot be saved.
        """
        file = io.BytesIO()
        try:
            _Pickler(file, self._number, self._classes.add).dump(self._root)
        except (pickle.PicklingError, TypeError, AttributeError, RecursionError) as error:
            raise StateError(str(error)) from None
        return file.getvalue()

    def load(self, state: bytes) -> Root:
        """Return (gated, controller) in a saved state: a controller behind its gate, and itself.

        Raises:
            StateError: the state is damaged, or is of another deployment or program.
        """
        try:
            for opcode, _, _ in pickletools.genops(state):
                if opcode.name not in OPCODES:
                    raise StateError(f"expected an opcode that is needed, got {opcode.name}")
            gated, controller = _Unpickler(io.BytesIO(state), self._find).load()
        except StateError:
            raise
        except Exception as error:  # of many classes: damaged, or of another version
            raise StateError(f"{type(error).__name__}: {error}") from None
        if type(gated) is not type(self._root[0]) or type(controller) is not type(self._root[1]):
            raise StateError("expected a controller, got another object")
        return gated, controller

    def _number(self, one: Any) -> int | None:
        """Return the number of an object that never changes; None for one saved by value."""
        number = self._numbers.get(id(one))
        if number is None and self._numbering:
            number = self._numbers[id(one)] = len(self._fixed)
            self._fixed.append(one)
            self._classes.add(type(one))  # changed sections are saved by value
        return number

    def _find(self, module: str, name: str) -> Any:
        """Return the class or function of a name; refuse a name that no state may contain."""
        if name == _fixed.__name__ and module == __name__:
            return self._fixed.__getitem__
        value = getattr(sys.modules.get(module), name, None)
        if value is _method or value in self._classes:
            return value
        # A class of a filter or an event that the new controller did not contain.
        package = module.rpartition(".")[0]
        ours = isinstance(value, type) and value.__module__ == module
        if ours and package in self._packages:
            return value
        raise StateError(f"expected a class of ours, got {module}.{name}")


def attributes(kind: Any) -> tuple[str, ...]:
    """Return the attributes that an instance of a class may have; none if ``pickle`` saves it.

    They are the names that the code of its methods stores. ``pickle`` would read ``__dict__``, and
    from then on CPython 3.11 looks up every attribute in a dictionary: a tick takes a fifth longer.
    """
    own = {"__reduce__", "__reduce_ex__", "__getstate__", "__getnewargs__", "__getnewargs_ex__"}
    if not kind.__dictoffset__ or issubclass(kind, FIXED):
        return ()
    if any(own & vars(base).keys() for base in kind.__mro__[:-1]):
        return ()
    names = set(getattr(kind, "__dataclass_fields__", ()))
    for base in kind.__mro__:
        for function in vars(base).values():
            if isinstance(function, FunctionType):
                names.update(_stored(function.__code__))
    return tuple(sorted(name for name in names if not hasattr(getattr(kind, name, 0), "__get__")))


def _stored(code: CodeType) -> Iterator[str]:
    """Yield the names of the attributes that a function stores, in any object."""
    operations, arguments = code.co_code[::2], code.co_code[1::2]
    at = operations.find(STORE_ATTR)
    while at >= 0:
        yield code.co_names[arguments[at]]
        at = operations.find(STORE_ATTR, at + 1)


class _Pickler(pickle.Pickler):
    def __init__(
        self, file: io.BytesIO, number: Callable[[Any], int | None], note: Callable[[type], None]
    ) -> None:
        super().__init__(file, PROTOCOL)
        self._number, self._note = number, note

    def reducer_override(self, one: Any) -> Any:
        kind = type(one)
        if one is _fixed or one is _method:
            return NotImplemented
        if isinstance(one, type):
            self._note(one)
            return NotImplemented
        if kind is MethodType:
            return _method, (one.__self__, one.__func__.__name__)
        if kind is BuiltinFunctionType and not isinstance(one.__self__, ModuleType):
            got = type(one.__self__).__name__
            raise pickle.PicklingError(f"expected a method of an object of ours, got one of {got}")
        if isinstance(one, FIXED) and (number := self._number(one)) is not None:
            return _fixed, (number,)
        names = _ATTRIBUTES.get(kind)
        if names is None:
            names = _ATTRIBUTES[kind] = attributes(kind)
        if not names:
            return NotImplemented
        held = [(name, getattr(one, name, MISSING)) for name in names]
        return __newobj__, (kind,), {name: value for name, value in held if value is not MISSING}


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, find: Callable[[str, str], Any]) -> None:
        super().__init__(file)
        self._find = find

    def find_class(self, module: str, name: str) -> Any:
        return self._find(module, name)
