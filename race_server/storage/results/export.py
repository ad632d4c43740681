"""What a results file holds as one table, for other programs: laps, or classifications."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path

from race_server.errors import ResultsError
from race_server.kept_file import write_file
from race_server.storage.csv_table import write_csv
from race_server.storage.results.queries import Row

_RACE = {
    "race": "int64",
    **dict.fromkeys(("started_at", "session", "track", "track_digest", "vehicle"), "string"),
    "race_laps": "int64",
    "pace": "string",
    "seed": "int64",
    **dict.fromkeys(("rules_version", "server_version", "ended"), "string"),
    **dict.fromkeys(("event", "format", "title"), "string"),
    "seat": "int64",
    "driver": "string",
    "driver_version": "string",
    "rank": "int64",
    "status": "string",
}
_LAPS = {"lap": "int64", "time_us": "int64", "sectors": "string", "is_clean": "bool_"}
_SUMS = ("laps", "best_lap_us", "race_time_us", "penalties", "penalty_us", "items_used")
_CLASSIFICATION = {
    **dict.fromkeys(_SUMS, "int64"),
    "ending": "string",
    "way": "float64",
    "moves": "int64",
}

# Name and type (of pyarrow) of each column, by what a row is about: a lap, or a kart in a race.
COLUMNS = {"laps": {**_RACE, **_LAPS}, "classification": {**_RACE, **_CLASSIFICATION}}


def export(rows: Sequence[Row], to: Path, kind: str) -> None:
    """Write rows of one kind, a key of `COLUMNS`, into a .csv or .parquet file.

    Raises:
        ResultsError: another kind of file, one that cannot be written, or no pyarrow.
    """
    if to.suffix == ".csv":
        write_csv(rows, to, list(COLUMNS[kind]))
    elif to.suffix == ".parquet":
        _write_parquet(rows, to, COLUMNS[kind])
    else:
        raise ResultsError(f"{to}: results are exported as .csv or .parquet")


def _write_parquet(rows: Sequence[Row], to: Path, columns: Mapping[str, str]) -> None:
    try:
        arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError as error:
        raise ResultsError(
            f"{to}: Parquet needs pyarrow, from the extra `results`: "
            "pip install 'race-server[results]'; .csv needs nothing"
        ) from error
    schema = arrow.schema([(name, getattr(arrow, kind)()) for name, kind in columns.items()])
    table = arrow.Table.from_pylist(list(rows), schema=schema)
    try:
        write_file(to, lambda file: parquet.write_table(table, file))
    except OSError as error:
        raise ResultsError(f"{to}: cannot be written: {error.strerror or error}") from error
