"""How compiled functions pass records of many arrays on: by where they lie in memory.

Numba passes a named tuple as one argument for each of its numbers. `Fields` has a thousand, and
most functions take it: half the time to compile went into writing down such calls. A tuple class
marked `@record` is passed as one pointer instead. An entry point copies what it is given; once all
functions are compiled into it LLVM sees that nothing changes the copy, and no pointer is left.
Compiled functions can read the fields of a record by name, and nothing else.

Each package has this same file, see `compiled.py`.
"""

from __future__ import annotations

import hashlib
from typing import Any

from . import compiled  # noqa: F401  # before numba, which it lets import less

# isort: split
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel.models import PrimitiveModel
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.core.pythonapi import NativeValue, unbox
from numba.core.typing.templates import AttributeTemplate
from numba.core.typing.typeof import typeof as numba_typeof
from numba.core.typing.typeof import typeof_impl
from numba.extending import infer_getattr, register_model


def record(tuple_class: Any) -> Any:
    """Mark a NamedTuple whose objects compiled functions pass on by their place in memory."""

    def type_of(value: Any, _context: Any) -> Any:
        return Record(tuple_class, tuple(numba_typeof(part) for part in value))

    typeof_impl.register(tuple_class)(type_of)
    return tuple_class


class Record(types.Type):
    """Numba's type of a record: its class, and the types of its fields."""

    def __init__(self, tuple_class: Any, members: tuple[Any, ...]) -> None:
        """Name it by all that machine code depends on; shortly, for symbols bear this name."""
        self.tuple_class, self.members = tuple_class, members
        whole = repr((tuple_class.__module__, tuple_class._fields, members))
        name = f"{tuple_class.__qualname__}_{hashlib.sha256(whole.encode()).hexdigest()[:24]}"
        super().__init__(name)

    def index(self, field: str) -> int | None:
        """Which of its fields has this name; None: none has."""
        fields = self.tuple_class._fields
        return fields.index(field) if field in fields else None


@infer_getattr
class _Fields(AttributeTemplate):
    key = Record

    def generic_resolve(self, of: Record, field: str) -> Any:  # type: ignore[override]
        index = of.index(field)
        return None if index is None else of.members[index]


@register_model(Record)
class _Model(PrimitiveModel):
    """A pointer to the fields; those that are records lie within."""

    def __init__(self, manager: Any, of: Record) -> None:
        models = [manager.lookup(member) for member in of.members]
        self.layout = ir.LiteralStructType([_layout(model) for model in models])
        super().__init__(manager, of, self.layout.as_pointer())

    def from_argument(self, builder: Any, value: Any) -> Any:
        if "alwaysinline" in builder.function.attributes:
            return value
        own = cgutils.alloca_once(builder, self.layout)  # of an entry point
        size = cgutils.sizeof(builder, value.type)
        cgutils.raw_memcpy(builder, own, value, size, 1)
        return own


def _layout(model: Any) -> Any:
    return getattr(model, "layout", None) or model.get_value_type()


@lower_getattr_generic(Record)
def _get(context: Any, builder: Any, of: Record, value: Any, field: str) -> Any:
    """Code that reads a field."""
    index = of.index(field)
    assert index is not None
    member, place = of.members[index], cgutils.gep_inbounds(builder, value, 0, index)
    inner = hasattr(context.data_model_manager.lookup(member), "layout")
    read = place if inner else builder.load(place)
    return impl_ret_borrowed(context, builder, member, read)


@unbox(Record)
def _unbox(of: Record, value: Any, c: Any) -> Any:
    """Code that takes a record from Python."""
    place = cgutils.alloca_once(c.builder, c.context.data_model_manager.lookup(of).layout)
    is_error = cgutils.alloca_once_value(c.builder, cgutils.false_bit)
    _unbox_into(place, of, value, c, is_error)
    return NativeValue(place, is_error=c.builder.load(is_error))


def _unbox_into(place: Any, of: Record, value: Any, c: Any, is_error: Any) -> None:
    for index, member in enumerate(of.members):
        part = c.pyapi.tuple_getitem(value, index)
        to = cgutils.gep_inbounds(c.builder, place, 0, index)
        if hasattr(c.context.data_model_manager.lookup(member), "layout"):
            _unbox_into(to, member, part, c, is_error)
            continue
        native = c.unbox(member, part)
        c.builder.store(native.value, to)
        with c.builder.if_then(native.is_error, likely=False):
            c.builder.store(cgutils.true_bit, is_error)
