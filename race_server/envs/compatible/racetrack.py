"""`Kart/RacetrackCompatible-v0`: a race track with the interface of highway-env's `racetrack-v0`.

Its roads as a course with run-off beside it, its car at 10 m/s that is only steered, five decisions
a second for at most 300 s, its occupancy grid, its reward and its ends. The vehicles ahead are
ours: `pure_pursuit` in cars of at most 7.5 m/s.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from gymnasium import Space, spaces

from race_server.core import codes
from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.vehicle_presets import HIGHWAY_CAR
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.compatible.cars import Array, Infos, Moved, begin_round, decisions_of
from race_server.envs.compatible.config import config_of
from race_server.envs.compatible.single import CompatibleEnv
from race_server.envs.compatible.vector import CompatibleVector
from race_server.envs.presets import LEARNING_RULES, task_on
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.scenario.race import Scenario
from race_server.scenario.track.course import Course
from race_server.scenario.track.highway_roads import highway_file
from race_server.scenario.track.load import course_in

NAME = "racetrack-v0"
FIXED = ("observation", "action", "controlled_vehicles", "speed_limit")
SPEED, AHEAD_SPEED = 10.0, 7.5  # [m/s]; of vehicles ahead theirs are 6 to 9
LANE = 5.0  # [m] width of each of two lanes
RUN_OFF = 6.0  # [m] beside them, where an episode ends
# The grid: 12 by 12 cells of 3 m around the car, along its axes.
CELL, CELLS = 3.0, 12
# Where the car begins, and the vehicle ahead: on the first straight, and in the bend behind it.
START, AHEAD = (20.0, 50.0), (58.0, 93.0)  # [m] behind the first road's beginning
MOST_OTHERS = 8
APART = 20.0  # [m] at least, between a further vehicle and the others


class RacetrackCars:
    """One car on each of many race tracks, with vehicles ahead."""

    defaults: ClassVar[Mapping[str, Any]] = MappingProxyType(
        {
            "observation": {
                "type": "OccupancyGrid",
                "features": ["presence", "on_road"],
                "grid_size": [[-18, 18], [-18, 18]],
                "grid_step": [3, 3],
                "as_image": False,
                "align_to_vehicle_axes": True,
            },
            "action": {
                "type": "ContinuousAction",
                "longitudinal": False,
                "lateral": True,
                "target_speeds": [0, 5, 10],
            },
            "controlled_vehicles": 1,
            "speed_limit": 10.0,
            "policy_frequency": 5,
            "duration": 300.0,
            "collision_reward": -1.0,
            "lane_centering_cost": 4.0,
            "lane_centering_reward": 1.0,
            "action_reward": -0.3,
            "other_vehicles": 1,
            "terminate_off_road": True,
        }
    )

    def __init__(self, changes: Mapping[str, Any], worlds: int) -> None:
        """Build the roads. changes: of the configuration.

        Raises:
            ScenarioError: the configuration is not valid.
            TrackError: highway-env is not installed: its roads are taken from it.
        """
        self.config = config_of(NAME, self.defaults, changes, FIXED)
        self._course, self._waypoints = _road()
        self.batch = Batch(self._task(), worlds=worlds, seed=None, after=STAY)
        self._steps = np.zeros(worlds, np.int64)
        self._actions = np.zeros((worlds, 4), np.float32)
        shape = (2, CELLS, CELLS)
        self.observation_space: Space[Any] = spaces.Box(-np.inf, np.inf, shape, np.float32)
        self.action_space: Space[Any] = spaces.Box(-1.0, 1.0, (1,), np.float32)

    def _task(self) -> Task:
        others = int(self.config["other_vehicles"])
        if not 0 <= others <= MOST_OTHERS:
            raise ScenarioError(
                f"{NAME}: config 'other_vehicles' is {others}; give 0 to {MOST_OTHERS}"
            )
        rules = replace(
            LEARNING_RULES,
            laps=0,
            standing_start=False,
            items=False,
            stopped_limit_s=0.0,
            limit_s=self.config["duration"] + 1.0,
            wall_contact="retire",
            kart_contact="retire",
        )
        slower = replace(HIGHWAY_CAR, top_speed=AHEAD_SPEED)
        cars = (HIGHWAY_CAR, *[slower] * others)
        scenario = Scenario(self._course, karts=1 + others, vehicles=cars, rules=rules)
        return task_on(
            (scenario,),
            learners=1,
            opponents=("pure_pursuit",) if others else (),
            observation=("speed",),
            action="control",
            decision_ticks=TICKS_PER_SECOND // self.config["policy_frequency"],
        )

    def begin(self, w: int, seed: int | None, chance: np.random.Generator) -> None:
        """Put one car on the first straight, and another one ahead of it in the same lane.

        chance: draws where, and how many more there are on the road, as highway-env does.
        """
        begin_round(self.batch, w, seed, chance)
        self._steps[w] = 0
        lane = int(chance.integers(2))
        self._put(w, 0, chance.uniform(*START), lane, SPEED)
        others = int(self.config["other_vehicles"])
        if others == 0:
            return
        self._put(w, 1, chance.uniform(*AHEAD), lane, AHEAD_SPEED)
        more = int(chance.integers(others))
        bodies = self.batch.world.bodies[w]
        for kart in range(2, 1 + others):
            along, side = chance.uniform(0.0, self._course.length), int(chance.integers(2))
            self._put(w, kart, along, side, AHEAD_SPEED)
            near = bodies[:kart][bodies[:kart]["status"] != codes.ABSENT]
            away = np.hypot(near["x"] - bodies[kart]["x"], near["y"] - bodies[kart]["y"])
            if kart - 2 >= more or away.min() < APART:
                bodies[kart]["status"] = codes.ABSENT

    def _put(self, w: int, kart: int, along: float, lane: int, speed: float) -> None:
        """Put a car into a lane, some way [m] along, at a speed [m/s]."""
        world, course = self.batch.world, self._course
        index = round(along / course.spacing) % len(course.line)
        x, y, heading, _ = course.line[index]
        aside = LANE * (lane - 0.5)
        body, racer = world.bodies[w, kart], world.racers[w, kart]
        body["x"], body["y"] = x - aside * np.sin(heading), y + aside * np.cos(heading)
        body["heading"], body["speed"], body["yaw_rate"] = heading, speed, 0.0
        racer["line_index"], racer["progress"] = index, index * course.spacing
        racer["lateral_offset"] = aside

    def observe(self) -> Array:
        """Return where vehicles are and where roads are, (W, 2, 12, 12)."""
        bodies = self.batch.world.bodies
        grid = np.zeros((len(bodies), 2, CELLS, CELLS), np.float32)
        cars = np.stack([bodies["x"], bodies["y"]], axis=2)
        _fill(grid[:, 0], bodies[:, 0], cars, bodies["status"] != codes.ABSENT)
        _fill(grid[:, 1], bodies[:, 0], self._waypoints[None], np.ones(1, np.bool_))
        return grid

    def move(self, actions: Array) -> Moved:
        """Move on. actions: (W, 1) steering, a share of 45°."""
        self._actions[:, 0] = np.clip(actions[:, 0], -1.0, 1.0)
        self.batch.step(self._actions)
        self._steps += 1
        config, infos = self.config, self.infos(actions)
        terms = infos["rewards"]
        weighed = config["lane_centering_reward"] * terms["lane_centering_reward"]
        weighed += config["action_reward"] * terms["action_reward"]
        weighed += config["collision_reward"] * terms["collision_reward"]
        # From the cost of a collision to 1, as 0 to 1; nothing off the road.
        least = config["collision_reward"]
        rewards = (weighed - least) / (1.0 - least) * terms["on_road_reward"]
        over = infos["crashed"].copy()
        if config["terminate_off_road"]:
            over |= ~terms["on_road_reward"]
        return Moved(rewards, over, self._steps >= decisions_of(config), infos)

    def infos(self, actions: Array) -> Infos:
        """Return speeds [m/s], crashes, and what the reward is made of."""
        world = self.batch.world
        offsets = world.racers["lateral_offset"][:, 0]
        lateral = np.abs(np.abs(offsets) - 0.5 * LANE)
        crashed = world.bodies["status"][:, 0] == codes.RETIRED
        return {
            "speed": world.bodies["speed"][:, 0].copy(),
            "crashed": crashed,
            "rewards": {
                "lane_centering_reward": 1.0
                / (1.0 + self.config["lane_centering_cost"] * lateral**2),
                "action_reward": np.linalg.norm(actions, axis=1),
                "collision_reward": crashed,
                "on_road_reward": np.abs(offsets) <= LANE,
            },
        }


class RacetrackCompatible(CompatibleEnv):
    """One car that is steered along a road, by the names and numbers of `racetrack-v0`."""

    cars_of = RacetrackCars


def racetrack_compatible_vector(
    num_envs: int = 1, config: Mapping[str, Any] | None = None, render_mode: str | None = None
) -> CompatibleVector:
    """Return `num_envs` cars, each on its own road. config: as of `RacetrackCompatible`."""
    return CompatibleVector(RacetrackCars(config or {}, num_envs), render_mode)


def _fill(layer: Array, own: Any, places: Array, are_there: Array) -> None:
    """Mark the cells that places lie in, seen from each world's own car.

    layer: (W, 12, 12); own: (W,) bodies; places: (W or 1, P, 2) [m]; are_there: which of them,
    (W, P) or (1,).
    """
    away_x = places[..., 0] - own["x"][:, None]
    away_y = places[..., 1] - own["y"][:, None]
    cos, sin = np.cos(own["heading"])[:, None] / CELL, np.sin(own["heading"])[:, None] / CELL
    along = np.floor(away_x * cos + away_y * sin).astype(np.int64) + CELLS // 2
    aside = np.floor(away_y * cos - away_x * sin).astype(np.int64) + CELLS // 2
    inside = (along >= 0) & (along < CELLS) & (aside >= 0) & (aside < CELLS) & are_there
    worlds, numbers = np.nonzero(inside)
    layer[worlds, along[worlds, numbers], aside[worlds, numbers]] = 1.0


@cache
def _road() -> tuple[Course, Array]:
    """Return the roads of `racetrack-v0` with run-off, and points in their lanes' middles.

    The points, (N, 2) [m], are 3 m apart.
    """
    words = highway_file("highway:racetrack-v0").decode()
    wide = words.replace("points = [", f"grass = {RUN_OFF}\npoints = [", 1)
    course = course_in("racetrack-v0-run-off", NAME, wide.encode())
    line = course.line[:: max(round(CELL / course.spacing), 1)]
    across = np.stack([-np.sin(line[:, 2]), np.cos(line[:, 2])], axis=1)
    sides = [line[:, :2] + side * LANE * across for side in (-0.5, 0.5)]
    return course, np.concatenate(sides)
