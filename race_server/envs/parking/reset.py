"""New rounds of parking: another lot is drawn, and every vehicle begins again."""

from typing import NamedTuple

from race_server.core import codes
from race_server.core.kernels.boxes import box_of, hull_of
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.rules.parking import judged_box
from race_server.core.stages.grid import line_up
from race_server.core.stages.lot_draw import draw_lot
from race_server.core.state import Records, World
from race_server.envs.buffers import Buffers
from race_server.envs.parking.heuristics.aim import goal_of
from race_server.envs.parking.heuristics.field import Field, find_ways
from race_server.envs.parking.heuristics.heuristic import NO_CELLS
from race_server.envs.parking.obstruction import stands_between
from race_server.envs.parking.reward_terms import look
from race_server.envs.rounds import begin_episode, next_round, put_from_template, seed_of_round


class LotTemplates(NamedTuple):
    """What each scenario's world looks like before its lot is drawn."""

    races: Records  # (S,) RACE
    rules: Records  # (S,) RULES
    bodies: Records  # (S, K) BODY
    racers: Records  # (S, K) RACER
    players: Records  # (S, K) PLAYER
    vehicles: Records  # (S, K) VEHICLE
    parkers: Records  # (S, K) PARKER
    field: Field  # of all worlds: the only part of this that changes


@large_kernel
def begin_round(world: World, buffers: Buffers, templates: LotTemplates, w: int) -> None:
    """Draw a scenario for one world, then its lot, and put every vehicle at its start."""
    scenario = next_round(buffers, w)
    world.races[w] = templates.races[scenario]
    world.rules[w] = templates.rules[scenario]
    world.races[w].seed = seed_of_round(buffers, w)
    for k in range(world.bodies.shape[1]):
        put_from_template(world, buffers, templates, w, k)
        world.parking.parkers[w, k] = templates.parkers[scenario, k]
    # Before a place is looked for: a gap may put a trailer farther behind.
    for k in range(buffers.rewards.shape[1]):
        begin_episode(world, buffers, w, k, world.bodies[w, k].status == codes.ABSENT)
    draw_lot(world, w)
    line_up(world, w)
    cells = int(buffers.settings[0].cells)
    if cells != NO_CELLS:
        place, spare = buffers.rounds[w].world, buffers.rounds[0].world
        find_ways(world, templates.field, w, place, spare, cells)
    for k in range(buffers.rewards.shape[1]):
        _begin_way(world, buffers, w, k)
        look(world, buffers, templates.field, w, k)


@kernel
def _begin_way(world: World, buffers: Buffers, w: int, k: int) -> None:
    """Begin the way of one learning vehicle."""
    body, episode = world.bodies[w, k], buffers.episodes[w, k]
    episode.parked = 0
    episode.ending = 0
    episode.walked_into = 0
    episode.moves = 0
    episode.ticks = 0
    episode.turn = episode.way = episode.reversed = 0.0
    before = buffers.before[w, k]
    before.steering = before.touches = before.hits = 0.0
    parker, vehicle = world.parking.parkers[w, k], world.vehicles[w, k]
    box, goal = (
        box_of(hull_of(vehicle, body, judged_box(parker, vehicle))),
        goal_of(vehicle, parker),
    )
    episode.between = int(stands_between(world, w, box.x, box.y, goal.x, goal.y))
