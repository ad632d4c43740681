"""Entrants of a club: a number for each name, kept over events.

The file is CSV with the columns `number` and `name`. A name keeps its number, and a number its
name; that of a driver who left is free only once its row is taken out of the file by hand.
"""

import csv
import io
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from race_server.errors import ScenarioError
from race_server.net.wire.strict import MOST_NAME
from race_server.printable import fault_of_name
from race_server.scenario.text_files import read_text
from race_server.storage.csv_table import csv_text, text_in
from race_server.storage.whole_file import write_whole
from race_server.user_data import path_named, user_data

VARIABLE = "RACE_SERVER_ENTRANTS"
COLUMNS = ("number", "name")
MOST_BYTES, MOST_NUMBER = 1 << 20, 9999
# Digits of a number that are read: Python refuses to read thousands of them.
MOST_DIGITS = 20


@dataclass(frozen=True)
class Import:
    """What a file brings: all entrants from now on, or what is wrong, row by row."""

    entrants: dict[str, int]  # number by name
    added: int
    faults: tuple[str, ...] = ()


def default_path() -> Path:
    """Return where the entrants of this user are kept."""
    if named := os.environ.get(VARIABLE):
        return path_named(named)
    return user_data("entrants.csv")


def known_entrants(path: Path) -> dict[str, int]:
    """Return the numbers that are kept, by name; none where there is no file.

    Raises:
        ScenarioError: the file cannot be read, or a row of it is wrong.
    """
    if not path.exists():
        return {}
    found = read_entrants(path, {})
    if found.faults:
        raise ScenarioError(f"{path}: {found.faults[0]}")
    return found.entrants


def read_entrants(path: Path, known: dict[str, int]) -> Import:
    """Return the entrants of a CSV file together with those that are known.

    A row without a number gets the lowest that is free; one without both is left out.

    Raises:
        ScenarioError: the file cannot be read, or has no column of names.
    """
    entrants, faults = dict(known), []
    seen: dict[str, int] = {}
    waiting = []
    for line, row in _rows_of(path):
        if any(map(str.strip, row.pop(None, None) or ())):
            faults.append(
                f"row {line}: more cells than the first row: put a name in quotation marks"
            )
            continue
        name, digits = text_in((row["name"] or "").strip()), (row.get("number") or "").strip()
        if not name and not digits:
            continue
        fault = _fault(name, digits, entrants, seen)
        if fault:
            faults.append(f"row {line}: {fault}")
        elif digits:
            entrants[name] = int(digits)
        elif name not in entrants:
            waiting.append((line, name))
        seen.setdefault(name, line)
    taken = set(entrants.values())
    free = (number for number in range(1, MOST_NUMBER + 1) if number not in taken)
    for line, name in waiting:
        if number := next(free, 0):
            entrants[name] = number
        else:
            faults.append(f"row {line}: no number is free for {name}; take out drivers who left")
    return Import(entrants, len(entrants) - len(known), tuple(faults))


def _rows_of(path: Path) -> list[tuple[int, dict[str | None, Any]]]:
    """Return the rows of a CSV file, each with the line on which it ends.

    Cells are apart by what is most frequent in the first row: commas, semicolons or tabulators.

    Raises:
        ScenarioError: it cannot be read, or its first row names no column `name`.
    """
    text = read_text(path, MOST_BYTES, ScenarioError)
    first = text.partition("\n")[0]
    table = csv.DictReader(io.StringIO(text), strict=True, delimiter=max(",;\t", key=first.count))
    try:
        names = [name.strip().lower() for name in table.fieldnames or ()]
        if "name" not in names or (
            "number" not in names and any(one not in {"", "name"} for one in names)
        ):
            raise ScenarioError(
                f"{path}: its first row has {', '.join(names) or 'nothing'}: it must name the "
                "columns number and name"
            )
        table.fieldnames = names
        return [(table.line_num, row) for row in table]
    except csv.Error as error:
        raise ScenarioError(f"{path}: no CSV after line {table.line_num}: {error}") from error


def _fault(name: str, digits: str, entrants: dict[str, int], seen: dict[str, int]) -> str:
    """Return what is wrong with a row, "" for nothing."""
    wrong = fault_of_name(name) if name else ""
    if wrong or not 0 < len(name) <= MOST_NAME:
        wrong = wrong or (f"{len(name)} characters" if name else "")
        has = f" has {wrong}" if wrong else ""
        return f"name {name[:MOST_NAME]!r}{has}: give 1 to {MOST_NAME} printable characters"
    if name in seen:
        return f"name {name!r} stands in row {seen[name]} already; take one of the two out"
    if not digits:
        return ""
    is_number = digits.isascii() and digits.isdigit() and len(digits) <= MOST_DIGITS
    if not is_number or not 1 <= int(digits) <= MOST_NUMBER:
        shown = digits[:MOST_DIGITS]
        return f"number {shown!r} of {name}: give a whole number from 1 to {MOST_NUMBER}"
    number = int(digits)
    if entrants.get(name, number) != number:
        return f"{name} has number {entrants[name]} already, not {number}; leave its number out"
    holder = next((one for one, taken in entrants.items() if taken == number), name)
    if holder != name:
        return f"number {number} of {name} is that of {holder}; choose another, or leave it out"
    return ""


def write_entrants(path: Path, entrants: dict[str, int]) -> None:
    """Write the entrants by number.

    Raises:
        ScenarioError: the file cannot be written.
    """
    held = sorted((number, name) for name, number in entrants.items())
    text = csv_text([dict(zip(COLUMNS, row, strict=True)) for row in held], COLUMNS)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text)
    except OSError as error:
        raise ScenarioError(
            f"entrants cannot be written to {path} ({error.strerror or error}); name another file "
            f"with ${VARIABLE}"
        ) from error
