"""What one round in a car park has drawn, as rectangles on the ground."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from race_server.core import codes
from race_server.core.state import World
from race_server.core.vehicle_presets import vehicle_named
from race_server.scenario.lot.footprint import Footprint
from race_server.scenario.parking import parking_scenario
from race_server.scenario.race import make_world


@dataclass(frozen=True)
class Drawn:
    """Starts and slots of the vehicles in order, and what stands there besides."""

    starts: tuple[Footprint, ...]  # of each vehicle as a whole, as if it stood straight
    boxes: tuple[tuple[Footprint, ...], ...]  # of each vehicle, as it stands
    slots: tuple[Footprint, ...]
    blocks: tuple[Footprint, ...]
    parked: tuple[Footprint, ...]
    people: tuple[tuple[float, float, float, float], ...]  # x, y, and x, y where they go first [m]


def draw_rounds(
    lot: str, seeds: Sequence[int], vehicle: str = "", vehicles: int = 1
) -> Iterator[Drawn]:
    """Yield the rounds of some seeds.

    vehicle: name, that of the lot where it is empty; vehicles: that drive there.

    Raises:
        LotError, VehicleError, ScenarioError: there is no such lot or vehicle, or there are more
            vehicles than slots.
    """
    scenario = parking_scenario(lot, vehicles=vehicles, vehicle=vehicle)
    size = vehicle_named(scenario.vehicle_of(0).name)
    whole, middle = (size.overall_length, size.overall_width), 0.5 * sum(size.ends)
    world = make_world(scenario, seeds=seeds)
    for w in range(len(seeds)):
        bodies = world.bodies[w]
        x = bodies["x"] + middle * np.cos(bodies["heading"])
        y = bodies["y"] + middle * np.sin(bodies["heading"])
        places = zip(x.tolist(), y.tolist(), bodies["heading"].tolist(), strict=True)
        parkers = world.parking.parkers[w]
        walkers = world.parking.walkers[w]
        yield Drawn(
            starts=tuple(Footprint(*place, *whole) for place in places),
            boxes=tuple(
                tuple(
                    Footprint(*box)
                    for box in size.boxes_at(
                        body.x, body.y, body.heading, body.trailers["heading"].tolist()
                    )
                )
                for body in bodies
            ),
            slots=tuple(Footprint(p.x, p.y, p.heading, p.length, p.width) for p in parkers),
            blocks=_blocks_of(world, w, codes.OBSTACLE),
            parked=_blocks_of(world, w, codes.KART_HIT),
            people=tuple((p.x, p.y, p.to_x, p.to_y) for p in walkers if p.radius > 0.0),
        )


def _blocks_of(world: World, w: int, kind: int) -> tuple[Footprint, ...]:
    """Return the blocks of one kind. kind: RayHit."""
    blocks = world.parking.blocks[w]
    return tuple(
        Footprint(one.x, one.y, one.heading, 2.0 * one.half_length, 2.0 * one.half_width)
        for one in blocks[blocks["kind"] == kind]
    )
