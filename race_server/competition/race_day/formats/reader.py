"""A format out of a TOML file, each value checked."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from race_server.competition.race_day.formats.format import (
    COUNTED,
    Format,
    Obstacles,
    Races,
    TimeTrial,
)
from race_server.competition.time_trial.run_spec import STARTS
from race_server.core.bounds import MOST_KARTS, MOST_ROUNDS, MOST_S
from race_server.errors import ScenarioError
from race_server.scenario.text_files import MOST_TOML, parse_toml, read_text
from race_server.scenario.toml_reader import TomlReader

MANUAL = "docs/race-day.md"
LETTERS = "ABCDEFGHIJ"
KINDS = ("time trial", "races")
MOST_STAGES, MOST_LAPS, MOST_POINTS = 16, 1000, 10_000


def read_format(path: Path) -> Format:
    """Return the format in a file; its name is that of the file.

    Raises:
        ScenarioError: the file cannot be read, is no TOML, or a value in it is wrong.
    """
    text = read_text(path, MOST_TOML, ScenarioError)
    try:
        words = parse_toml(text)
    except ValueError as error:
        raise ScenarioError(f"{path}: no TOML: {error}") from error
    form = format_of(path.stem, words, str(path))
    # Not where the file of an event is read, which may be older than these rules.
    form.check_names(str(path))
    for stage in form.stages:
        if isinstance(stage, TimeTrial) and stage.least_points > stage.best_points:
            raise ScenarioError(
                f"{path}: {stage.name}: least_points = {stage.least_points}: give at most "
                f"best_points, which is {stage.best_points}"
            )
        if isinstance(stage, Races) and stage.least > stage.most:
            raise ScenarioError(
                f"{path}: {stage.name}: least = {stage.least}: give at most most, which is "
                f"{stage.most}"
            )
    return form


def words_of(form: Format) -> dict[str, Any]:
    """Return the tables from which `format_of` makes a format again."""
    stages = []
    for stage in form.stages:
        kind = KINDS[isinstance(stage, Races)]
        words = {key: value for key, value in asdict(stage).items() if value is not None}
        words |= {"points": list(stage.points)} if isinstance(stage, Races) else {}
        stages.append({"kind": kind, **words})
    return {"title": form.title, "stage": stages}


def format_of(name: str, words: dict[str, Any], file: str) -> Format:
    """Return the format in the tables of a file, which are used up. file: named in errors.

    Raises:
        ScenarioError: a value is wrong.
    """
    reader = TomlReader(file, words, ScenarioError, MANUAL, {"stage": MOST_STAGES})
    title = reader.text("title", name)
    stages = tuple(_stage(one) for one in reader.tables("stage"))
    reader.no_more()
    names = [stage.name for stage in stages]
    if not stages:
        raise reader.wrong("stage", "", "give [[stage]] tables, each with a name")
    if len(set(names)) < len(names):
        raise reader.wrong("stage", ", ".join(names), "give each stage a name that no other has")
    return Format(name, title, stages)


def _stage(reader: TomlReader) -> TimeTrial | Races:
    kind = reader.choice("kind", KINDS, "")
    stage = _time_trial(reader) if kind == KINDS[0] else _races(reader)
    reader.no_more()
    return stage


def _time_trial(reader: TomlReader) -> TimeTrial:
    plain = TimeTrial("", "")
    obstacles = None
    if "obstacles" in reader.words:
        table, usual = reader.table("obstacles"), Obstacles()
        obstacles = Obstacles(
            table.number("every_lengths", usual.every_lengths, 2.0, 1e4),
            table.number("passage_widths", usual.passage_widths, 1.0, 100.0),
        )
        table.no_more()
    return TimeTrial(
        name=reader.text("name", "Time trial"),
        track=reader.choice("track", tuple(LETTERS), "A"),
        laps=_whole(reader, "laps", plain.laps, 1, MOST_LAPS),
        attempts=_whole(reader, "attempts", plain.attempts, 1, MOST_ROUNDS),
        failure_s=reader.number("failure_s", plain.failure_s, 1.0, MOST_S),
        obstacles=obstacles,
        best_points=_whole(reader, "best_points", 0, 0, MOST_POINTS),
        least_points=_whole(reader, "least_points", 0, 0, MOST_POINTS),
        counts=reader.choice("counts", COUNTED, plain.counts),
        start=reader.choice("start", STARTS, plain.start),
    )


def _races(reader: TomlReader) -> Races:
    plain = Races("", "", 1)
    tracks = reader.text("tracks", "A")
    if not set(tracks) <= set(LETTERS) or len(set(tracks)) < len(tracks):
        raise reader.wrong("tracks", tracks, f"give letters of {LETTERS}, each once")
    points = reader.take("points", [])
    if not isinstance(points, list) or len(points) > MOST_KARTS or not all(map(_is_points, points)):
        raise reader.wrong("points", points, f"give whole numbers from 0 to {MOST_POINTS}")
    most = _whole(reader, "most", plain.most, 1, MOST_KARTS)
    least = _whole(reader, "least", min(plain.least, most), 1, MOST_KARTS)
    return Races(
        name=reader.text("name", "Race"),
        tracks=tracks,
        laps=_whole(reader, "laps", 5, 1, MOST_LAPS),
        rounds=_whole(reader, "rounds", plain.rounds, 1, MOST_ROUNDS),
        most=most,
        least=least,
        mixed=reader.yes("mixed"),
        qualified=_whole(reader, "qualified", 0, 0, MOST_KARTS),
        points=tuple(points),
        finishing=_whole(reader, "finishing", 0, 0, MOST_POINTS),
        limit_s=reader.number("limit_s", plain.limit_s, 1.0, MOST_S),
    )


def _whole(reader: TomlReader, key: str, default: int, low: int, high: int) -> int:
    value = reader.number(key, default, low, high)
    if not value.is_integer():
        raise reader.wrong(key, value, f"give a whole number from {low} to {high}")
    return int(value)


def _is_points(value: object) -> bool:
    return type(value) is int and 0 <= value <= MOST_POINTS
