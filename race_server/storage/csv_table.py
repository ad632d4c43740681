"""Tables as .csv files that a spreadsheet may open: text in them is data, never a formula."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from race_server.errors import ResultsError
from race_server.printable import printable
from race_server.storage.whole_file import write_whole

# What a spreadsheet takes for the beginning of a formula; the last four are as wide as a kanji.
FORMULA = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")


def write_csv(rows: Sequence[dict[str, Any]], path: Path, columns: Sequence[str] = ()) -> None:
    """Write rows as a .csv file, see `csv_text`.

    Raises:
        ResultsError: the file cannot be written.
    """
    try:
        write_whole(path, csv_text(rows, columns))
    except OSError as error:
        raise ResultsError(f"{path}: cannot be written: {error.strerror or error}") from error


def csv_text(rows: Sequence[dict[str, Any]], columns: Sequence[str] = ()) -> str:
    """Return rows as the text of a .csv file; a list becomes numbers separated by spaces.

    columns: their names in order; those of the first row, if none are given. Text that a
    spreadsheet would compute gets an apostrophe before it, which says: this is text.
    """
    text = io.StringIO()
    names = list(columns or (rows[0] if rows else ()))
    table = csv.DictWriter(text, names, lineterminator="\n")
    if names:
        table.writeheader()
    table.writerows({name: cell(value) for name, value in row.items()} for row in rows)
    return text.getvalue()


def cell(value: Any) -> Any:
    """Return a value as it stands in a .csv file."""
    if isinstance(value, list):
        return " ".join(str(part) for part in value)
    if not isinstance(value, str):
        return value
    text = printable(value)
    return f"'{text}" if _is_formula(text) else text


def text_in(cell: str) -> str:
    """Return the text that stands in a cell of a .csv file, without the apostrophe before it."""
    return cell[1:] if cell.startswith("'") and _is_formula(cell[1:]) else cell


def _is_formula(text: str) -> bool:
    # Behind an apostrophe, too: with one more the reader knows which is of the text.
    return text.lstrip(" '").startswith(FORMULA)
