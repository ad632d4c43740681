"""`race replay` and `race recording`: check, watch, inspect and cut recordings."""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from race_server.cli.document import AsJson, print_document
from race_server.core.clock import TICKS_PER_SECOND, lap_text
from race_server.errors import RecordingError
from race_server.terminal import Console, say

if TYPE_CHECKING:
    from race_server.storage.recording.rerun import Rerun

app = typer.Typer(help="Inspect a recording, print its messages, or cut it.")

File = Annotated[Path, typer.Argument(help="Recording (.mcap file).")]


def replay(
    file: File,
    play: Annotated[
        bool, typer.Option("--play", help="Show the race in the terminal instead of checking it.")
    ] = False,
    speed: Annotated[
        float,
        typer.Option(
            min=0.001, max=10_000.0, help="With --play: speed as a multiple of real time."
        ),
    ] = 1.0,
    seek: Annotated[float, typer.Option(help="With --play: start at this time [s].")] = 0.0,
    as_json: AsJson = False,
) -> None:
    """Simulate a recorded race again and compare it with the recording; or show it.

    Exit code 1 if the two differ, or nothing in the recording tells.
    """
    from race_server.storage.recording.reader import read_recording

    if play and as_json:
        raise RecordingError("--play shows the race, --json is of the check: leave one of them out")
    recording = read_recording(file)
    if play:
        from race_server.cli.recording_view import show

        show(recording, Console(), speed=speed, seek_s=seek)
        return
    document = check(recording)
    if as_json:
        print_document(document)
    else:
        _print_check(document)
    if not document["ok"]:
        raise typer.Exit(1)


def check(recording: Any) -> dict[str, Any]:
    """Return whether a simulated race equals the recorded one, with the first difference.

    It does not where there is nothing to compare.
    """
    from race_server.storage.recording.rerun import Rerun

    rerun = Rerun(recording, is_blind=True)
    begun = time.perf_counter()
    for _ in rerun.run():
        pass
    took = time.perf_counter() - begun
    difference = rerun.difference
    raced_s = rerun.session.tick / TICKS_PER_SECOND
    return {
        "ok": difference is None and rerun.compared > 0,
        "why": _why(rerun),
        "file": str(recording.path),
        "ticks": rerun.session.tick,
        "digests": rerun.compared,
        "digest": rerun.session.digest(),
        "is_complete": recording.is_complete,
        "is_torn": recording.is_torn,
        "first_difference_tick": None if difference is None else difference.tick,
        "seconds": round(took, 3),
        "times_real_time": round(raced_s / took) if took > 0.0 else 0,
    }


def _why(rerun: "Rerun") -> str:
    """Return why a race that was driven again is not the recorded one, or nothing."""
    from race_server.storage.recording.header import versions

    difference = rerun.difference
    if difference is None:
        return "" if rerun.compared else "nothing to compare: no digest is in the recording"
    recorded, now = json.loads(rerun.recording.start.versions), versions()
    other = [
        f"{name} {value} (here {now.get(name, 'none')})"
        for name, value in recorded.items()
        if now.get(name) != value
    ]
    told = f"; it was recorded with {', '.join(other)}" if other else ""
    if difference.recorded_to is not None:
        return (
            f"the simulated race ended at tick {difference.tick}, the recorded one went on to "
            f"tick {difference.recorded_to}{told}"
        )
    return f"the simulated race differs from the recorded one from tick {difference.tick} on{told}"


def _print_check(document: dict[str, Any]) -> None:
    seconds = document["ticks"] / TICKS_PER_SECOND
    state = "complete" if document["is_complete"] else "not finished"
    if document["is_torn"]:
        state += ", cut short: read up to its last whole chunk"
    console = Console(soft_wrap=True)
    if document["ok"]:
        console.print(
            f"the same race: {document['digests']} digests are equal, {seconds:.1f} s simulated "
            f"in {document['seconds']:.2f} s ({state})"
        )
    else:
        console.print(f"{document['why']} ({state})", style="red")


@app.command()
def info(file: File, as_json: AsJson = False) -> None:
    """Show drivers, course, time, laps and message counts of a recording."""
    from race_server.storage.recording.reader import Line, read_lines, read_recording

    recording = read_recording(file)
    start, setting = recording.start, json.loads(recording.start.setting)
    counts: dict[str, int] = {}
    for line in read_lines(file):
        if isinstance(line, Line):
            counts[line.kind.key] = counts.get(line.kind.key, 0) + 1
    laps = [
        {"seat": seat, "number": number, "time_us": time_us, "tick": tick}
        for seat, number, time_us, tick in recording.laps
    ]
    document = {
        "file": str(file),
        "bytes": file.stat().st_size,
        "session": start.session,
        "started_at": start.started_at,
        "track": setting["course"]["name"],
        "track_digest": setting["course"]["digest"],
        "vehicles": [vehicle["name"] for vehicle in setting["vehicles"]],
        "seed": setting["seed"],
        "pace": start.pace,
        "versions": json.loads(start.versions),
        "drivers": {row.number: row.driver for row in start.seats},
        "ticks": recording.last_tick,
        "is_complete": recording.is_complete,
        "is_torn": recording.is_torn,
        "laps": laps,
        "messages": counts,
    }
    if as_json:
        print_document(document)
    else:
        _print_info(document)


def _print_info(document: dict[str, Any]) -> None:
    console = Console()
    facts = Table("", show_header=False, box=None)
    facts.add_column(overflow="fold")
    seconds = document["ticks"] / TICKS_PER_SECOND
    state = "complete" if document["is_complete"] else "not finished"
    rows = {
        "session": f"{document['session']}, begun {document['started_at']}",
        "track": f"{document['track']} ({document['track_digest'][:12]})",
        "vehicle": ", ".join(dict.fromkeys(document["vehicles"])),
        "pace, seed": f"{document['pace']}, {document['seed']}",
        "length": f"{seconds:.1f} s, {state}{', cut short' if document['is_torn'] else ''}",
        "versions": ", ".join(f"{name} {value}" for name, value in document["versions"].items()),
        "size": f"{document['bytes'] / 1e6:.2f} MB",
        "messages": ", ".join(f"{name} {count}" for name, count in document["messages"].items()),
    }
    for name, value in rows.items():
        facts.add_row(name, value)
    console.print(facts)
    laps = Table("seat", "driver", "laps", "best lap")
    for seat, driver in document["drivers"].items():
        times = [lap["time_us"] for lap in document["laps"] if lap["seat"] == seat]
        laps.add_row(str(seat), driver, str(len(times)), lap_text(min(times, default=0)))
    console.print_whole(laps)


@app.command()
def cat(
    file: File,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document per line.")
    ] = False,
    channel: Annotated[
        str, typer.Option(help="Print only this channel, such as laps. Default: all.")
    ] = "",
) -> None:
    """Print the messages of a recording, one per line."""
    from race_server.storage.recording.to_json import to_json

    for at_s, key, words in _messages(file, channel, to_json):
        if as_json:
            print_document({"time_s": round(at_s, 6), "channel": key, **words})
        else:
            told = ", ".join(f"{name} {value}" for name, value in words.items())
            say(f"{at_s:10.3f}  {key:16} {told}"[:240])


def _messages(file: Path, channel: str, to_json: Any) -> Iterator[tuple[float, str, Any]]:
    from race_server.storage.recording.channels import CHANNELS
    from race_server.storage.recording.reader import Line, read_lines

    known = [kind.key for kind in CHANNELS]
    if channel and channel not in known:
        raise RecordingError(f"channel {channel!r} is unknown; choose one of {', '.join(known)}")
    first = None
    for line in read_lines(file):
        if not isinstance(line, Line):
            continue
        first = line.time_ns if first is None else first
        if not channel or line.kind.key == channel:
            yield (line.time_ns - first) / 1e9, line.kind.key, to_json(line)


@app.command()
def cut(
    file: File,
    target: Annotated[Path, typer.Argument(help="New recording (.mcap file).")],
    until: Annotated[float, typer.Option(help="End of the part to keep [s].")],
) -> None:
    """Copy the first part of a recording into another file that replays by itself."""
    from race_server.storage.recording.excerpt import write_excerpt

    ticks = write_excerpt(file, target, until)
    say(f"{target}: {ticks / TICKS_PER_SECOND:.1f} s of {file}")
