"""Values of frozen dataclasses that are computed once for all copies that have the same data for them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, Self, TypeVar, overload

Value = TypeVar("Value")


class SharedValue(Generic[Value]):
    """A property whose value is kept in a dictionary of its object, by its name.

    ``dataclasses.replace`` passes the dictionary on, so that a copy with the same data computes nothing again; one with
    other data is given an empty dictionary.
    """

    def __init__(self, holder: str, compute: Callable[[Any], Value]) -> None:
        self._holder, self._compute, self.__doc__ = holder, compute, compute.__doc__

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type) -> Value: ...
    def __get__(self, instance: object | None, owner: type) -> Value | Self:
        if instance is None:
            return self
        values, name = getattr(instance, self._holder), self._compute.__name__
        if name not in values:
            values[name] = self._compute(instance)
        value: Value = values[name]
        instance.__dict__[name] = value  # found there from now on
        return value


def shared_in(holder: str) -> Callable[[Callable[[Any], Value]], SharedValue[Value]]:
    """Decorate a method so that it is such a property; ``holder``: the name of the dictionary."""
    return lambda compute: SharedValue(holder, compute)
