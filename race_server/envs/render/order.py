"""The text block of a picture: the time, and the order of the karts."""

from collections.abc import Sequence

import numpy as np

from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.state import Bytes, World
from race_server.envs.render.brush import shortened, tile, write
from race_server.envs.render.colours import FAINT, INK, colour_of, ink_on
from race_server.envs.render.view import COLUMNS, View


def draw_order(
    frame: Bytes, view: View, world: World, w: int, present: list[int], names: Sequence[str]
) -> None:
    """Write the time and a line for each kart that is present; `names` are those of all karts."""
    race, laps, text = world.races[w], int(world.rules[w].laps), view.text
    has_line = world.route.courses[world.rules[w].course].line_count > 0
    race_s = (race.tick - race.start_tick) * TICK_S
    left, right, row = 0.8 * text, (COLUMNS - 0.6) * text, view.row
    write(frame, f"{race_s:.1f} s", round(1.3 * text), (left, 1.1 * row), INK)
    order = sorted(present, key=lambda k: (world.racers[w, k].rank, k))
    for line, k in enumerate(order[: int(view.size[1] / row) - 3]):
        body, racer, y = world.bodies[w, k], world.racers[w, k], (2.4 + line) * row
        ink = FAINT if body.status == codes.RETIRED else INK
        colour = colour_of(body, k)
        write(frame, str(racer.rank), text, (left + 0.9 * text, y), FAINT, 1.0)
        middle = np.array([left + 2.1 * text, y])
        tile(frame, middle, round(1.5 * text), round(1.2 * text), colour)
        write(frame, str(k), round(0.85 * text), (middle[0], y), ink_on(colour), 0.5)
        if k < len(names):
            name = shortened(names[k], text, round(right - left - 5.5 * text))
            write(frame, name, text, (left + 3.2 * text, y), ink)
        count = f"{racer.laps}/{laps}" if laps else str(racer.laps)
        if not has_line:
            count = "parked" if body.status == codes.FINISHED else ""
        count = "out" if body.status == codes.RETIRED else count
        write(frame, count, text, (right, y), ink, 1.0)
