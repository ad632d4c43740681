"""The leaderboard and the events of a race as text for a terminal."""

from collections.abc import Sequence
from dataclasses import dataclass

from rich.table import Table
from rich.text import Text

from race_server.core.clock import lap_text, seconds_of
from race_server.core.messages import (
    Ending,
    Event,
    EventKind,
    Flag,
    Phase,
    PoseFault,
    Retirement,
    Standing,
    Status,
    Trust,
)

_STATUS = {
    Status.ABSENT: "absent",
    Status.RACING: "racing",
    Status.FINISHED: "home",
    Status.RETIRED: "out",
}
_ENDINGS = {
    Ending.OPEN: "on the way",
    Ending.PARKED: "parked",
    Ending.LATE: "out of time",
    Ending.LEFT: "too far away",
    Ending.WALL: "hit a wall",
    Ending.BLOCK: "hit an obstacle",
    Ending.VEHICLE: "hit a vehicle",
    Ending.PERSON: "hit a person",
    Ending.WITHDREW: "withdrew",
    Ending.JACK_KNIFE: "jack-knifed",
    Ending.OWN_BODY: "touched itself",
}
_ENDING_STYLE = {Ending.OPEN: "", Ending.PARKED: "green"}
_FLAG_STYLE = {Flag.GREEN: "green", Flag.YELLOW: "yellow", Flag.RED: "red"}
_MEDALS = {1: "bold yellow", 2: "bold white", 3: "bold dark_orange3"}


@dataclass(frozen=True)
class Headline:
    """What is shown above the table."""

    session: str
    course: str
    laps: int
    phase: Phase = Phase.LOBBY
    flag: Flag = Flag.GREEN
    race_s: float = 0.0

    def text(self) -> Text:
        """Return the headline as one line."""
        laps = f"  {self.laps} laps  " if self.laps else "  "
        line = Text.assemble((self.session, "bold"), "  ", self.course, laps)
        line.append(self.phase.name.lower(), style="bold cyan")
        if self.phase in {Phase.COUNTDOWN, Phase.RUNNING}:
            line.append(f"  {self.race_s:7.1f} s")
        line.append("  ●", style=_FLAG_STYLE[self.flag])
        return line


def leaderboard(headline: Headline, standings: Sequence[Standing]) -> Table:
    """Return the standings as a table: of a race, or in a car park of all ways to a slot."""
    if not headline.laps and any(row.parking for row in standings):
        return _parking_board(headline, standings)
    table = _empty_table(headline)
    for name in ("laps", "last", "best", "time", "gap", "pen.", "items"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("status", no_wrap=True)
    best = min((row.best_lap_us for row in standings if row.best_lap_us), default=0)
    for row in standings:
        fastest = "bold magenta" if row.best_lap_us and row.best_lap_us == best else ""
        table.add_row(
            Text(str(row.rank), style=_MEDALS.get(row.rank, "")),
            f"{row.driver} {row.seat}",
            str(row.laps),
            lap_text(row.last_lap_us),
            Text(lap_text(row.best_lap_us), style=fastest),
            lap_text(row.race_time_us),
            _gap(row),
            _penalties(row),
            str(row.items_used),
            _status(row),
        )
    return table


def _status(row: Standing) -> str:
    """Return how a kart fares, and its way to a slot after a race, where it goes to one."""
    words = _STATUS[row.status]
    return f"{words}, {_ENDINGS[row.parking.ending]}" if row.parking else words


def _empty_table(headline: Headline) -> Table:
    """Return a table with the headline, and columns for place and driver."""
    table = Table(
        title=headline.text(),
        title_justify="left",
        header_style="dim underline",
        box=None,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    for name in ("", "driver"):
        table.add_column(name, no_wrap=True)
    return table


def _parking_board(headline: Headline, standings: Sequence[Standing]) -> Table:
    """Return how all vehicles fare on their way to their slots, as a table."""
    table = _empty_table(headline)
    for name in ("slot", "time", "way", "reversed", "moves"):
        table.add_column(name, justify="right", no_wrap=True)
    is_measured = any(row.planned for row in standings)
    if is_measured:
        table.add_column("× plan", justify="right", no_wrap=True)
    table.add_column("status", no_wrap=True)
    for row in standings:
        parking = row.parking
        if parking is None:
            continue
        table.add_row(
            str(row.rank),
            f"{row.driver} {row.seat}",
            str(parking.slot) if parking.slot >= 0 else "–",
            lap_text(row.race_time_us),
            f"{parking.way:.1f} m",
            f"{parking.reversed:.1f} m",
            str(parking.moves),
            *([_beside_plan(row)] if is_measured else []),
            Text(_ENDINGS[parking.ending], style=_ENDING_STYLE.get(parking.ending, "red")),
        )
    return table


def _beside_plan(row: Standing) -> str:
    """Return time and way as multiples of the plan's, and how many changes of direction it has."""
    plan, parking = row.planned, row.parking
    if plan is None or parking is None:
        return ""
    time, way = seconds_of(row.race_time_us) / plan.time_s, parking.way / plan.path_m
    return f"{time:.2f} {way:.2f} ({plan.direction_changes})"


def _gap(row: Standing) -> str:
    return f"+{seconds_of(row.gap_us):.3f}" if row.gap_us > 0 else ""


def _penalty(given_us: int) -> str:
    """Return a penalty in words, one below 0 as what was taken back."""
    words = "s penalty" if given_us >= 0 else "s of penalties taken back"
    return f"{seconds_of(abs(given_us)):g} {words}"


def _penalties(row: Standing) -> str:
    return f"+{seconds_of(row.penalty_us):g} s" if row.penalties else "–"


def event_text(event: Event, names: Sequence[str], items: Sequence[str]) -> str:
    """Return an event as a short sentence, empty for events that are not shown.

    names: of the drivers by seat; items: names of the items by number - 1.
    """
    who = _name(event.kart, names)
    other = _name(event.other, names)
    sentences = {
        EventKind.GREEN: "lights out",
        EventKind.LAP: f"{who}: lap {event.other} in {lap_text(event.value)}",
        EventKind.FINISH: f"{who} finishes",
        EventKind.RETIRED: f"{who} is out ({_reason(event.other)})",
        EventKind.PICK_UP: f"{who} picks up {_item(event.other, items)}",
        EventKind.USE: f"{who} uses {_item(event.other, items)}",
        EventKind.HIT: f"{who} is hit by {_item(event.value, items)} of {other}",
        EventKind.BLOCKED_HIT: f"{who} takes {_item(event.value, items)} of {other} unharmed",
        EventKind.CONTACT_KART: f"{who} and {other} touch",
        EventKind.FALSE_START: f"{who} starts before the lights",
        EventKind.SHORT_CUT: f"{who} misses gate {event.other}",
        EventKind.WRONG_WAY: f"{who} drives the wrong way" if event.value else "",
        EventKind.OFF_TRACK: f"{who} leaves the track" if event.value else "",
        EventKind.STUCK: f"{who} is stuck",
        EventKind.RESCUED: f"{who} is put back on the line",
        EventKind.PENALTY: f"{who}: {_penalty(event.value)}",
        EventKind.RACE_OVER: "the race is over",
        EventKind.WARNING: f"{who} is warned for driving into {other}",
        EventKind.PARKED: f"{who} is parked{_slot(event.other)}",
        EventKind.HIT_PERSON: f"{who} hits a person",
    }
    if event.kind is EventKind.FLAG:
        around = f" around {who}" if event.kart >= 0 else ""
        return f"{Flag(event.other).name.lower()} flag{around}"
    if event.kind is EventKind.POSE:
        return f"{who} is {_pose(event)}"
    return sentences.get(event.kind, "")


def _name(kart: int, names: Sequence[str]) -> str:
    return names[kart] if 0 <= kart < len(names) else "nobody"


def _item(number: int, items: Sequence[str]) -> str:
    return items[number - 1] if 1 <= number <= len(items) else f"item {number}"


def _slot(number: int) -> str:
    return f" in slot {number}" if number >= 0 else ""


def _pose(event: Event) -> str:
    why = f" ({PoseFault(event.value).name.lower().replace('_', ' ')})" if event.value else ""
    return f"{Trust(event.other).name.lower()}{why}"


def _reason(reason: int) -> str:
    known = {int(value): value.name.lower().replace("_", " ") for value in Retirement}
    return known.get(reason, "unknown")
