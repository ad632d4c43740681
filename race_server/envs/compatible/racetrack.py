"""`Kart/RacetrackCompatible-v0`: a race track with the interface of highway-env's `racetrack-v0`.

Its roads as a course with run-off beside it, its car at 10 m/s that is only steered, five decisions
a second for at most 300 s, its occupancy grid, its reward and its ends. The vehicle ahead is ours:
`pure_pursuit` in a car of at most 7.5 m/s.
"""

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from race_server.core import codes
from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.vehicle_presets import HIGHWAY_CAR
from race_server.envs.presets import LEARNING_RULES, task_on
from race_server.envs.single import OneKart
from race_server.scenario.race import Scenario
from race_server.scenario.track.course import Course
from race_server.scenario.track.highway_roads import highway_file
from race_server.scenario.track.load import course_in

Array = NDArray[Any]

DECISION_TICKS = TICKS_PER_SECOND // 5
LIMIT_S = 300.0
SPEED, AHEAD_SPEED = 10.0, 7.5  # [m/s]; of vehicles ahead theirs are 6 to 9
LANE = 5.0  # [m] width of each of two lanes
RUN_OFF = 6.0  # [m] beside them, where an episode ends
# The grid: 12 by 12 cells of 3 m around the car, along its axes.
CELL, CELLS = 3.0, 12
# Of the reward, which is then mapped from [-1, 1] to [0, 1]; nothing off the road.
CENTRING, CENTRING_COST, STEERED, CRASHED = 1.0, 4.0, -0.3, -1.0
# Where the car begins, and the vehicle ahead: on the first straight, and in the bend behind it.
START, AHEAD = (20.0, 50.0), (58.0, 93.0)  # [m] behind the first road's beginning


class RacetrackCompatible(gymnasium.Env[Any, Array]):
    """One car that is steered along a road, by the names and numbers of `racetrack-v0`."""

    metadata = OneKart.metadata

    def __init__(self, render_mode: str | None = None) -> None:
        """Build the road.

        Raises:
            TrackError: highway-env is not installed: its roads are taken from it.
        """
        self.render_mode = render_mode
        self._course = _course()
        rules = replace(
            LEARNING_RULES,
            laps=0,
            standing_start=False,
            items=False,
            stopped_limit_s=0.0,
            limit_s=LIMIT_S + 1.0,
            wall_contact="retire",
            kart_contact="retire",
        )
        cars = (HIGHWAY_CAR, replace(HIGHWAY_CAR, top_speed=AHEAD_SPEED))
        scenario = Scenario(self._course, karts=2, vehicles=cars, rules=rules)
        task = task_on(
            (scenario,),
            learners=1,
            opponents=("pure_pursuit",),
            observation=("speed",),
            action="control",
            decision_ticks=DECISION_TICKS,
        )
        self._race = OneKart(task, render_mode=render_mode)
        self._waypoints = _waypoints(self._course)
        self._steps = 0
        shape = (2, CELLS, CELLS)
        self.observation_space = spaces.Box(-np.inf, np.inf, shape, np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin a new episode; with a seed the same one again. Options are not used."""
        super().reset(seed=seed)
        self._race.reset(seed=seed)
        self._steps = 0
        lane = int(self.np_random.integers(2))
        self._put(0, self.np_random.uniform(*START), lane, SPEED)
        self._put(1, self.np_random.uniform(*AHEAD), lane, AHEAD_SPEED)
        action = self.action_space.sample()
        return self._grid(), self._info(action, crashed=False)

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Move on by 0.2 s. action: (1,) steering, a share of 45°."""
        steering = float(np.clip(np.asarray(action, np.float64), -1.0, 1.0)[0])
        self._race.step(np.array([steering, 0.0, 0.0, 0.0], np.float32))
        self._steps += 1
        crashed = int(self._race.batch.world.bodies[0, 0]["status"]) == codes.RETIRED
        info = self._info(action, crashed=crashed)
        terms = info["rewards"]
        weighed = CENTRING * terms["lane_centering_reward"] + STEERED * terms["action_reward"]
        weighed += CRASHED * terms["collision_reward"]
        reward = 0.5 * (weighed + 1.0) * terms["on_road_reward"]
        is_over = crashed or not terms["on_road_reward"]
        is_cut = self._steps * DECISION_TICKS >= LIMIT_S * TICKS_PER_SECOND
        return self._grid(), float(reward), is_over, is_cut, info

    def _put(self, kart: int, along: float, lane: int, speed: float) -> None:
        """Put a car into a lane, some way [m] along, at a speed [m/s]."""
        world, course = self._race.batch.world, self._course
        index = round(along / course.spacing) % len(course.line)
        x, y, heading, _ = course.line[index]
        aside = LANE * (lane - 0.5)
        body, racer = world.bodies[0, kart], world.racers[0, kart]
        body["x"], body["y"] = x - aside * np.sin(heading), y + aside * np.cos(heading)
        body["heading"], body["speed"], body["yaw_rate"] = heading, speed, 0.0
        racer["line_index"], racer["progress"] = index, index * course.spacing
        racer["lateral_offset"] = aside

    def _grid(self) -> Array:
        """Return where vehicles are and where roads are, (2, 12, 12)."""
        grid = np.zeros((2, CELLS, CELLS), np.float32)
        bodies = self._race.batch.world.bodies[0]
        own = bodies[0]
        here = bodies["status"] != codes.ABSENT
        cars = np.stack([bodies["x"], bodies["y"]], axis=1)[here]
        for layer, places in enumerate((cars, self._waypoints)):
            away = places - (own["x"], own["y"])
            cos, sin = np.cos(own["heading"]), np.sin(own["heading"])
            along, aside = away[:, 0] * cos + away[:, 1] * sin, away[:, 1] * cos - away[:, 0] * sin
            cells = np.floor(np.stack([along, aside]) / CELL).astype(int) + CELLS // 2
            inside = ((cells >= 0) & (cells < CELLS)).all(axis=0)
            grid[layer, cells[0, inside], cells[1, inside]] = 1.0
        return grid

    def _info(self, action: Any, *, crashed: bool) -> dict[str, Any]:
        world = self._race.batch.world
        body, offset = world.bodies[0, 0], float(world.racers[0, 0]["lateral_offset"])
        lateral = abs(abs(offset) - 0.5 * LANE)
        return {
            "speed": float(body["speed"]),
            "crashed": crashed,
            "action": action,
            "rewards": {
                "lane_centering_reward": 1.0 / (1.0 + CENTRING_COST * lateral**2),
                "action_reward": float(np.linalg.norm(action)),
                "collision_reward": crashed,
                "on_road_reward": abs(offset) <= LANE,
            },
        }

    def render(self) -> Any:
        """Return the race as a picture (`rgb_array`), or show it in a window (`human`)."""
        return self._race.render()

    def close(self) -> None:
        """Close the window."""
        self._race.close()


def _course() -> Course:
    """Return the roads of `racetrack-v0` with run-off beside them."""
    words = highway_file("highway:racetrack-v0").decode()
    wide = words.replace("points = [", f"grass = {RUN_OFF}\npoints = [", 1)
    return course_in("racetrack-v0-run-off", "racetrack-v0", wide.encode())


def _waypoints(course: Course) -> Array:
    """Return points in the middle of both lanes, 3 m apart: (N, 2) [m]."""
    line = course.line[:: max(round(CELL / course.spacing), 1)]
    across = np.stack([-np.sin(line[:, 2]), np.cos(line[:, 2])], axis=1)
    sides = [line[:, :2] + side * LANE * across for side in (-0.5, 0.5)]
    return np.concatenate(sides)
