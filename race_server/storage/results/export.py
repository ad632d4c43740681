"""All laps of a results file as one table, for other programs."""

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from race_server.errors import ResultsError
from race_server.kept_file import write_file
from race_server.storage.csv_table import write_csv
from race_server.storage.results.queries import Row

_NUMBERS = ("race", "race_laps", "seed", "seat", "rank", "lap", "time_us")
_WORDS = ("started_at", "session", "track", "track_digest", "vehicle", "pace", "rules_version")
_MORE_WORDS = ("server_version", "ended", "driver", "driver_version", "status", "sectors")
_OF_AN_EVENT = ("event", "format", "title")
TYPES = {
    **dict.fromkeys(_NUMBERS, "int64"),
    **dict.fromkeys((*_WORDS, *_MORE_WORDS, *_OF_AN_EVENT), "string"),
    "is_clean": "bool_",
}


def export(laps: Sequence[Row], to: Path) -> None:
    """Write laps into a .csv or .parquet file.

    Raises:
        ResultsError: another kind of file, one that cannot be written, or no pyarrow.
    """
    if to.suffix == ".csv":
        write_csv(laps, to, list(TYPES))
    elif to.suffix == ".parquet":
        _write_parquet(laps, to)
    else:
        raise ResultsError(f"{to}: results are exported as .csv or .parquet")


def _write_parquet(laps: Sequence[Row], to: Path) -> None:
    try:
        arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError as error:
        raise ResultsError(
            f"{to}: Parquet needs pyarrow, from the extra `results`: "
            "pip install 'race-server[results]'; .csv needs nothing"
        ) from error
    schema = arrow.schema([(name, getattr(arrow, kind)()) for name, kind in TYPES.items()])
    table = arrow.Table.from_pylist(list(laps), schema=schema)
    try:
        write_file(to, lambda file: parquet.write_table(table, file))
    except OSError as error:
        raise ResultsError(f"{to}: cannot be written: {error.strerror or error}") from error
