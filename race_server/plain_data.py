"""Frozen dataclasses out of the plain data of a JSON file, each value checked by its annotation."""

from dataclasses import MISSING, fields, is_dataclass
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

Made = TypeVar("Made")

# More is no number of ours.
_MOST = 2**63 - 1
_KINDS = {
    str: "a text",
    int: "a whole number of 64 bits",
    float: "a number",
    bool: "true or false",
    tuple: "a list",
    dict: "a table",
}


def made_of(kind: type[Made], words: object, name: str = "") -> Made:
    """Return a dataclass whose fields are these values. name: of what is read, in errors.

    A value that is one of its dataclass already stays. Lists become tuples.

    Raises:
        ValueError: a field is missing, unknown, or of another type than it is annotated with.
    """
    table = _checked(dict, words, name or "the file")
    hints, before = get_type_hints(kind), f"{name}." if name else ""
    unknown = [key for key in table if key not in hints]
    if unknown:
        raise ValueError(f"{before}{_short(unknown[0])[1:-1]} is unknown")
    values = {}
    for field in fields(kind):  # type: ignore[arg-type]
        if field.name in table:
            where = before + field.name
            values[field.name] = _checked(hints[field.name], table[field.name], where)
        elif field.default is MISSING and field.default_factory is MISSING:
            raise ValueError(f"{before}{field.name} is missing")
    return kind(**values)


def _checked(hint: Any, value: Any, name: str) -> Any:
    kind = get_origin(hint) or hint
    if isinstance(kind, type) and is_dataclass(kind) and not isinstance(value, kind):
        return made_of(kind, value, name)
    if not _is_of(kind, value):
        raise ValueError(f"{name} = {_short(value)}: give {_KINDS.get(kind, kind.__name__)}")
    if kind is tuple:
        inner = get_args(hint)[0]
        return tuple(_checked(inner, one, f"{name}[{n}]") for n, one in enumerate(value))
    if kind is dict and (inners := get_args(hint)):
        inner = inners[1]
        return {key: _checked(inner, one, f"{name}.{key}") for key, one in value.items()}
    return value


def _is_of(kind: type, value: object) -> bool:
    if kind in {int, float}:
        is_bare = isinstance(value, int) and not isinstance(value, bool)
        fits = is_bare and -_MOST <= value <= _MOST  # type: ignore[operator]
        return fits or (kind is float and isinstance(value, float))
    return isinstance(value, list | tuple if kind is tuple else kind)


def _short(value: object) -> str:
    return repr(value)[:60]
