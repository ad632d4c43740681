"""`race bench onboard`: how long a turn of a real kart's control unit takes; its golden vectors."""

from pathlib import Path
from typing import Annotated, Any

import typer

from race_server.cli.document import AsJson, print_document
from race_server.core.seeds import MOST_SEED
from race_server.kept_file import check_place
from race_server.terminal import say

MILLI = 1e3
MOST_P99_MS = 1.0


def bench_onboard(
    track: Annotated[str, typer.Option(help="Course that is driven.")] = "hangar-400",
    vehicle: Annotated[str, typer.Option(help="Vehicle that is driven.")] = "kart-60",
    seconds: Annotated[
        float, typer.Option(min=2.0, max=600.0, help="Length of the drive [s].")
    ] = 60.0,
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of the drive.")] = 1,
    golden: Annotated[
        Path | None,
        typer.Option(help="Write inputs and outputs of the drive to this .npz file, for a port."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure sense and decide, turn by turn: of each turn the least time of five passes.

    The drive has every sensor and faults of each; fixes come 100 ms late, so that five turns in
    fifty drive the filter's past again.
    """
    import os

    if golden is not None:
        check_place(golden)
    os.environ["RACE_SERVER_INTERPRET"] = "1"  # one course needs no compiler
    import numpy as np

    from race_agents.plant.golden_drive import golden_turns, turn_times
    from race_agents.unit.fence import CourseFence
    from race_agents.unit.golden import pack
    from race_server.core.vehicle_presets import vehicle_named
    from race_server.scenario.track.load import load_course

    course, kart = load_course(track), vehicle_named(vehicle)
    fence = CourseFence.of(course.line, course.half_widths, course.kerb, course.borders)
    turns = golden_turns(course, kart, seconds=seconds, seed=seed)
    times = MILLI * turn_times(kart, fence, turns)
    document: dict[str, Any] = {
        "ok": bool(np.quantile(times, 0.99) < MOST_P99_MS),
        "turns": len(times),
        "median_ms": round(float(np.median(times)), 3),
        "p99_ms": round(float(np.quantile(times, 0.99)), 3),
        "most_ms": round(float(times.max()), 3),
    }
    if golden is not None:
        np.savez_compressed(golden, allow_pickle=False, **pack(kart, fence, turns))
        document["golden"] = str(golden)
    if as_json:
        print_document(document)
    else:
        say(", ".join(f"{name.replace('_', ' ')} {value}" for name, value in document.items()))
