"""All heuristics by name and number, and the kernel that asks one of them."""

from collections.abc import Mapping
from types import MappingProxyType

from race_server.core.kernels.jit import large_kernel
from race_server.core.vehicles import Vehicle
from race_server.envs.parking.heuristics import (
    bfs,
    cost_to_go,
    euclid,
    forward,
    grid,
    hybrid,
    privileged,
    reeds_shepp,
    trailer_car,
)
from race_server.envs.parking.heuristics.aim import Aim
from race_server.envs.parking.heuristics.heuristic import Chart, Heuristic
from race_server.errors import ScenarioError

NOTHING = Heuristic("none", "nothing: no way is left anywhere")
_ALL = (
    *(NOTHING, euclid.HEURISTIC, bfs.HEURISTIC, grid.HEURISTIC, reeds_shepp.HEURISTIC),
    *(hybrid.HEURISTIC, trailer_car.HEURISTIC, privileged.HEURISTIC, forward.HEURISTIC),
    cost_to_go.HEURISTIC,
)
# Their numbers, in this order.
NONE, EUCLID, BFS, GRID, REEDS_SHEPP, HYBRID, TRAILER_CAR, PRIVILEGED, FORWARD, COST_TO_GO = range(
    len(_ALL)
)

HEURISTICS: Mapping[str, Heuristic] = MappingProxyType({one.name: one for one in _ALL})
NUMBERS: Mapping[str, int] = MappingProxyType({one.name: n for n, one in enumerate(_ALL)})

_euclid, _bfs, _grid, _reeds_shepp = euclid.way, bfs.way, grid.way, reeds_shepp.way
_hybrid, _trailer_car, _privileged = hybrid.way, trailer_car.way, privileged.way
_forward, _cost_to_go = forward.way, cost_to_go.way


@large_kernel
def way_left(number: int, aim: Aim, chart: Chart) -> float:
    """Return the way [m] that a heuristic says is left. number: of `NUMBERS`."""
    if number == EUCLID:
        return _euclid(aim, chart)
    if number == BFS:
        return _bfs(aim, chart)
    if number == GRID:
        return _grid(aim, chart)
    if number == REEDS_SHEPP:
        return _reeds_shepp(aim, chart)
    if number == HYBRID:
        return _hybrid(aim, chart)
    if number == TRAILER_CAR:
        return _trailer_car(aim, chart)
    if number == PRIVILEGED:
        return _privileged(aim, chart)
    if number == FORWARD:
        return _forward(aim, chart)
    if number == COST_TO_GO:
        return _cost_to_go(aim, chart)
    return 0.0


def heuristic_named(name: str) -> Heuristic:
    """Return a heuristic by name.

    Raises:
        ScenarioError: there is none.
    """
    if name not in HEURISTICS:
        raise ScenarioError(f"heuristic {name!r} is unknown; choose one of {', '.join(HEURISTICS)}")
    return HEURISTICS[name]


def check_vehicle(heuristic: Heuristic, vehicle: Vehicle) -> None:
    """Check that a heuristic is one for a vehicle.

    Raises:
        ScenarioError: it needs a trailer that the vehicle does not draw, or only one.
    """
    count = len(vehicle.trailers)
    if not _fits(heuristic, count):
        few = "one trailer" if heuristic.has_trailer else "one trailer or none"
        fitting = ", ".join(name for name, one in HEURISTICS.items() if _fits(one, count))
        raise ScenarioError(
            f"heuristic {heuristic.name!r} is for vehicles with {few}, and "
            f"{vehicle.name!r} draws {count}; choose one of {fitting}"
        )


def _fits(heuristic: Heuristic, trailers: int) -> bool:
    """Return whether a heuristic is for vehicles with this number of trailers."""
    if heuristic.has_trailer:
        return trailers == 1
    return trailers <= 1 or not heuristic.has_atlas
