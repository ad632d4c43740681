"""How many karts one core can simulate, with sensors, and where time is spent."""

import time
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from race_server.core import codes
from race_server.core.clock import SUBSTEPS, TICK_S
from race_server.core.kernels.jit import bind, kernel
from race_server.core.stages.allowances import set_allowances
from race_server.core.stages.contacts import find_contact_pairs
from race_server.core.stages.grid import line_up
from race_server.core.stages.items import end_effects, use_items
from race_server.core.stages.judging import touch_karts, touch_walls
from race_server.core.stages.motion import move_bodies
from race_server.core.stages.pick_ups import pick_up_items
from race_server.core.stages.progress import follow_course
from race_server.core.stages.sensing import scan_lidar, scan_radar
from race_server.core.stages.standings import close_race, rank
from race_server.core.stages.stewarding import steward
from race_server.core.state import Floats, World
from race_server.core.step import advance
from race_server.core.vehicle_presets import TT02
from race_server.scenario.race import Rules, Scenario, make_world
from race_server.scenario.sensors import Lidar, Radar
from race_server.scenario.track.course import Course

WORLDS, KARTS, DECISION_TICKS = 64, 8, 3


@dataclass(frozen=True)
class BenchSetting:
    """One configuration to measure."""

    course: Course
    sensors: int
    worlds: int = WORLDS
    karts: int = KARTS

    def world(self) -> World:
        """Return worlds in which all karts race, spread over the course."""
        decision_s = DECISION_TICKS * TICK_S
        scenario = Scenario(
            self.course,
            karts=self.karts,
            vehicles=(TT02,),
            rules=Rules(laps=0, countdown_s=0.0, limit_s=0.0),
            lidar=replace(Lidar(), period_s=decision_s),
            radar=replace(Radar(), period_s=decision_s),
            fitted=(self.sensors,),
        )
        world = make_world(scenario, seeds=range(self.worlds))
        spread_out(world)
        for _ in range(400):
            advance(world, lane_keeping(world), DECISION_TICKS)
            world.event_counts[:] = 0
        return world


def spread_out(world: World) -> None:
    """Place the karts of every world at equal distances around the course."""
    line = world.route.line
    places = np.linspace(0, len(line), world.bodies.shape[1], endpoint=False).astype(int)
    for name in ("x", "y", "heading"):
        world.bodies[name] = line[name][places]
    for w in range(len(world.races)):
        line_up(world, w)


def lane_keeping(world: World) -> Floats:
    """Return controls that keep every kart near the centre line, each at another speed."""
    bodies, racers = world.bodies, world.racers
    controls = np.zeros((*bodies.shape, 4))
    line = world.route.line
    bend = line["curvature"][racers["line_index"]]
    wanted = bend - 1.5 * racers["lateral_offset"] - 2.0 * racers["heading_error"]
    controls[..., 0] = np.clip(np.arctan(wanted * TT02.wheelbase) / TT02.steering_limit, -1, 1)
    pace = 1.5 + 0.02 * np.arange(bodies.shape[1])
    controls[..., 1] = np.clip(pace - bodies["speed"], -1.0, 1.0)
    controls[..., 3] = (world.races["tick"][:, None] // DECISION_TICKS) % 2 * codes.USE_ITEM
    # Karts in a jam take turns to reverse.
    jammed = (racers["still_ticks"] > 60) & (world.races["tick"][:, None] % 120 < 60)
    controls[..., 1] = np.where(jammed, -1.0, controls[..., 1])
    controls[..., 3] += codes.ACCEPT_RESCUE
    return controls


def measure(setting: BenchSetting, *, seconds: float = 2.0) -> dict[str, float]:
    """Return agent-steps per second of one core; an agent-step is one decision of one kart."""
    world = setting.world()
    agents = setting.worlds * setting.karts
    controls = lane_keeping(world)
    move = bind(advance, world, controls, DECISION_TICKS)  # as a session does
    spent, steps = 0.0, 0
    while spent < seconds:
        controls[...] = lane_keeping(world)
        begun = time.process_time()
        move()
        spent += time.process_time() - begun
        steps += agents
        world.event_counts[:] = 0
    per_second = steps / spent
    return {
        "agent_steps_per_s": round(per_second),
        "agent_seconds_per_cpu_second": round(per_second * DECISION_TICKS * TICK_S),
        "ns_per_agent_step": round(1e9 / per_second, 1),
    }


@kernel
def _move(world: World, rounds: int) -> None:
    for _ in range(rounds):
        for w in range(world.bodies.shape[0]):
            move_bodies(world.bodies[w], world.vehicles[w])


@kernel
def _walls(world: World, rounds: int) -> None:
    for _ in range(rounds):
        for w in range(world.bodies.shape[0]):
            touch_walls(world, w)


@kernel
def _karts(world: World, rounds: int) -> None:
    for _ in range(rounds):
        for w in range(world.bodies.shape[0]):
            find_contact_pairs(world.bodies[w], world.vehicles[w], world.turns[w])
            for _ in range(SUBSTEPS):
                touch_karts(world, w)


@kernel
def _course(world: World, rounds: int) -> None:
    for _ in range(rounds):
        for w in range(world.bodies.shape[0]):
            follow_course(world, w)


@kernel
def _rules(world: World, rounds: int) -> None:
    for _ in range(rounds):
        for w in range(world.bodies.shape[0]):
            end_effects(world, w)
            set_allowances(world, w)
            use_items(world, w)
            steward(world, w)
            pick_up_items(world, w)
            rank(world, w)
            close_race(world, w)


@kernel
def _lidar(world: World, rounds: int) -> None:
    for _ in range(rounds):
        for w in range(world.bodies.shape[0]):
            for k in range(world.bodies.shape[1]):
                scan_lidar(world, w, k)


@kernel
def _radar(world: World, rounds: int) -> None:
    for _ in range(rounds):
        for w in range(world.bodies.shape[0]):
            for k in range(world.bodies.shape[1]):
                scan_radar(world, w, k)


def profile(course: Course) -> dict[str, float]:
    """Return the time of each part of one agent-step [ns], measured alone in a loop."""
    world = BenchSetting(course, codes.LIDAR | codes.RADAR).world()
    substeps = DECISION_TICKS * SUBSTEPS
    rays = len(world.sight.lidar_rays)
    parts: list[tuple[str, Callable[[World, int], None], int]] = [
        ("motion", _move, substeps),
        ("kart_contacts", _karts, DECISION_TICKS),
        ("wall_contacts", _walls, substeps),
        ("progress_and_laps", _course, DECISION_TICKS),
        ("rules_items_ranking", _rules, DECISION_TICKS),
        ("radar", _radar, 1),
        ("lidar", _lidar, 1),
    ]
    result = {}
    for name, part, times in parts:
        result[f"{name}_ns"] = round(times * _nanoseconds(part, world), 1)
    result["motion_ns_per_substep"] = round(result["motion_ns"] / substeps, 1)
    result["wall_contact_ns_per_substep"] = round(result["wall_contacts_ns"] / substeps, 1)
    result["radar_ns_per_ray"] = round(result["radar_ns"] / len(world.sight.radar_rays), 1)
    result["lidar_ns_per_ray"] = round(result["lidar_ns"] / rays, 1)
    return result


def _nanoseconds(part: Callable[[World, int], None], world: World) -> float:
    """Return the CPU time of one call for one kart [ns], the best of five runs."""
    world = deepcopy(
        world
    )  # so that the effects of one part, such as karts in walls, do not reach the next
    part(world, 1)
    agents = world.bodies.size
    rounds = 20
    best = np.inf
    for _ in range(5):
        begun = time.process_time()
        part(world, rounds)
        best = min(best, (time.process_time() - begun) / rounds / agents)
    return float(best) * 1e9


def bench_core(course: Course, *, seconds: float = 2.0) -> dict[str, Any]:
    """Return the figures of `race bench core`."""
    parts = profile(course)
    radar = measure(BenchSetting(course, codes.RADAR), seconds=seconds)
    lidar = measure(BenchSetting(course, codes.LIDAR), seconds=seconds)
    blind = measure(BenchSetting(course, 0), seconds=seconds)
    radar["ns_per_ray"] = parts["radar_ns_per_ray"]
    lidar["ns_per_ray"] = parts["lidar_ns_per_ray"]
    parts["without_sensors_agent_steps_per_s"] = blind["agent_steps_per_s"]
    return {
        "course": course.name,
        "worlds": WORLDS,
        "karts": KARTS,
        "radar": radar,
        "lidar": lidar,
        "profile": parts,
    }
