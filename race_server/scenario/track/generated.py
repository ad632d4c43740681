"""Random courses: ``generated:block:17``, ``generated:spline:4``, ``generated:circuit:9``.

Kind and seed define the course: the same name always gives the same track file.
"""

import math
import re
from functools import cache
from random import Random

from race_server.errors import TrackError
from race_server.scenario.track.blocks import Loop
from race_server.scenario.track.course import Floats
from race_server.scenario.track.random_blocks import draw_blocks
from race_server.scenario.track.random_circuits import draw_circuit
from race_server.scenario.track.random_splines import draw_spline

PREFIX = "generated:"
FORMS = (
    *("generated:block:SEED", "generated:spline:SEED", "generated:spline:SEED:kart"),
    *("generated:circuit:SEED", "generated:circuit:SEED:kart"),
)

_WRITTEN = {"block": "blocks", "spline": "spline", "circuit": "line"}
_NAME = re.compile(r"generated:(block|spline|circuit):(0|[1-9][0-9]{0,8})(:kart)?")


@cache
def generated_file(name: str) -> bytes:
    """Return the track file of a generated course's name.

    Raises:
        TrackError: the name is not valid.
    """
    match = _NAME.fullmatch(name)
    if match is None or (match[1] == "block" and match[3]):
        raise TrackError(f"track {name!r} cannot be generated; write {', '.join(FORMS)}")
    kind, seed, scale = match[1], int(match[2]), "kart" if match[3] else "1/10"
    chance = Random(f"{kind} {scale} {seed}")
    # Half of them the other way round, so that policies learn both directions.
    words = [
        f'title = "Generated {kind} course {seed}{" for karts" if match[3] else ""}"',
        f'form = "{_WRITTEN[kind]}"',
        f'scale = "{scale}"',
        f"reverse = {str(chance.random() < 0.5).lower()}",
    ]
    if kind == "block":
        outer, inner, place = draw_blocks(chance)
        words += [f"line_at = [{place[0]:g}, {place[1]:g}]", *_table(outer), *_table(inner)]
    else:
        draw = draw_circuit if kind == "circuit" else draw_spline
        words += ["points = [", *_rows(draw(chance, scale)), "]"]
    return "\n".join([*words, ""]).encode()


def _table(loop: Loop) -> list[str]:
    degrees = round(math.degrees(loop.heading))
    return [
        f"[{loop.name}]",
        f"start = [{loop.x:g}, {loop.y:g}]",
        f"heading = {degrees}",
        f'blocks = "{loop.blocks}"',
    ]


def _rows(points: Floats) -> list[str]:
    return [f"    [{', '.join(f'{number:.3f}' for number in row)}]," for row in points]
