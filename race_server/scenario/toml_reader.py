"""The values of a settings file, taken out one by one and checked."""

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_server.errors import RaceError

FARTHEST = 1e5  # [m] of any coordinate
MOST_LETTERS = 64  # of a text


@dataclass
class TomlReader:
    """The values of a TOML file.

    error: what is raised; manual: the page that lists the keys; most_rows: of each list of rows.
    """

    file: str
    words: dict[str, Any]
    error: type[RaceError]
    manual: str
    most_rows: Mapping[str, int] = field(default_factory=dict)

    def wrong(self, key: str, value: object, way_out: str) -> RaceError:
        """Return the error that names a key, its value and what to give instead."""
        if value is None:
            return self.error(f"{self.file}: {key} is missing: {way_out}")
        try:
            text = (repr(value) if isinstance(value, str) else str(value))[:60]
        except ValueError:  # of an integer in hexadecimal that Python writes in no other way
            text = "an integer of thousands of digits"
        return self.error(f"{self.file}: {key} = {text}: {way_out}")

    def take(self, key: str, default: Any) -> Any:
        """Take a value out, unchecked."""
        return self.words.pop(key, default)

    def table(self, key: str) -> "TomlReader":
        """Take a table out; an empty one where there is none."""
        value = self.take(key, {})
        if not isinstance(value, dict):
            raise self.wrong(key, value, f"give a table [{key}]")
        return self._inside(key, value)

    def tables(self, key: str) -> "list[TomlReader]":
        """Take a list of tables out."""
        value = self.take(key, [])
        most = self.most_rows.get(key, 0)
        if not isinstance(value, list) or not all(isinstance(one, dict) for one in value):
            raise self.wrong(key, value, f"give tables [[{key}]]")
        if len(value) > most:
            raise self.wrong(key, f"{len(value)} tables", f"give up to {most}")
        return [self._inside(f"{key}[{n}]", one) for n, one in enumerate(value, start=1)]

    def _inside(self, key: str, words: dict[str, Any]) -> "TomlReader":
        return TomlReader(f"{self.file}, {key}", words, self.error, self.manual, self.most_rows)

    def text(self, key: str, default: str) -> str:
        """Take a text of one line out."""
        value = self.take(key, default)
        if not isinstance(value, str) or not 0 < len(value.strip()) <= MOST_LETTERS:
            raise self.wrong(key, value, f"give a text of up to {MOST_LETTERS} characters")
        return " ".join(value.split())

    def choice(self, key: str, choices: Iterable[str], default: str) -> str:
        """Take one of several texts out."""
        value = self.take(key, default)
        if value not in tuple(choices):
            raise self.wrong(key, value, f"choose one of {', '.join(choices)}")
        return str(value)

    def yes(self, key: str) -> bool:
        """Take a truth value out; false where there is none."""
        value = self.take(key, False)
        if not isinstance(value, bool):
            raise self.wrong(key, value, "say true or false")
        return value

    def number(self, key: str, default: float, low: float, high: float) -> float:
        """Take a number out of a range."""
        value = self.take(key, default)
        if not is_number(value) or not low <= value <= high:
            raise self.wrong(key, value, f"give a number from {low:g} to {high:g}")
        return float(value)

    def whole(self, key: str, default: int, low: int, high: int) -> int:
        """Take a whole number out of a range; 12.0 is one, 12.5 is none."""
        value = self.take(key, default)
        if not is_number(value) or not low <= value <= high or value != int(value):
            raise self.wrong(key, value, f"give a whole number from {low} to {high}")
        return int(value)

    def pair(self, key: str) -> tuple[float, float] | None:
        """Take two numbers out, if they are there."""
        value = self.take(key, None)
        if value is None:
            return None
        row = self.row(key, value, 2)
        return row[0], row[1]

    def row(self, key: str, value: object, columns: int) -> list[float]:
        """Return a value as a list of numbers."""
        fits = isinstance(value, list) and len(value) == columns and all(map(is_number, value))
        if not isinstance(value, list) or not fits or max(map(abs, value)) > FARTHEST:
            raise self.wrong(key, value, f"give {columns} numbers, each up to {FARTHEST:g}")
        return [float(number) for number in value]

    def rows(self, key: str, columns: int, default: NDArray[np.float64]) -> NDArray[np.float64]:
        """Take a list of rows of numbers out, shape (N, columns)."""
        value = self.take(key, None)
        if value is None:
            return default
        if not isinstance(value, list) or len(value) > self.most_rows[key]:
            raise self.wrong(
                key, value, f"give a list of up to {self.most_rows[key]} rows of {columns} numbers"
            )
        rows = [self.row(f"{key}[{n}]", row, columns) for n, row in enumerate(value, start=1)]
        return np.array(rows).reshape(-1, columns)

    def no_more(self) -> None:
        """Check that nothing is left: a misspelt key is no setting."""
        if self.words:
            key = next(iter(self.words))
            raise self.wrong(key, self.words[key], f"no such key; see {self.manual}")


def is_number(value: object) -> bool:
    """Return whether a value is a finite number, and no integer beyond all of them."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= sys.float_info.max


def bytes_of_name(name: str, file: str, fault: type[RaceError]) -> bytes:
    """Return the name of a course, which is that of its file, as bytes.

    Raises:
        RaceError: of the type `fault`: the name is not UTF-8.
    """
    try:
        return name.encode()
    except UnicodeEncodeError as error:  # half of a surrogate pair stands for a byte of another
        raise fault(f"{file}: a course has its file's name in UTF-8; rename it") from error
