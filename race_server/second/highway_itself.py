"""An environment of highway-env as it is, behind one of our worlds: `racetrack-v0` itself.

Its own vehicle is driven by the controls of kart 0, its own other vehicles are the other karts, and
its own end of an episode ends the race: off the road, a crash, or its time. What a driver sees is
made of that by our code, on the same roads as a course.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.kernels.geometry import wrap_angle
from race_server.core.messages import Retirement
from race_server.core.stages.controls import take_controls
from race_server.core.stages.events import retire
from race_server.core.state import Floats, Record, World
from race_server.core.step import advance_world
from race_server.errors import ScenarioError
from race_server.scenario.highway import make_highway
from race_server.scenario.race import Scenario
from race_server.scenario.track.highway_roads import PREFIX, parts_of
from race_server.second.highway_motion import (
    ACCELERATION,
    STEERING,
    pedal_gain,
    shift,
    take_from,
    ticks_in,
)
from race_server.second.similarity import Similarity

NAME = "highway-env-itself"
DECISION_S = 0.2
PEDALS, CRASH_ONLY = "pedals", "crash-only"
WORDS = (PEDALS, CRASH_ONLY)


@dataclass(frozen=True)
class ItselfOptions:
    """What of its environment is changed: by default nothing, and it is only steered."""

    pedals: bool = False  # its action has acceleration, too
    # Only a crash or its time ends an episode: there are strips between its lanes, up to 9 cm wide
    # on the slanted straight of `racetrack-v0`, on which it calls a vehicle off the road.
    crash_only: bool = False

    @classmethod
    def of(cls, text: str) -> "ItselfOptions":
        """Return options from words such as ``pedals,crash-only``.

        Raises:
            ScenarioError: there is another word.
        """
        words = [word for word in text.split(",") if word]
        if strange := [word for word in words if word not in WORDS]:
            raise ScenarioError(f"{NAME} knows no option {strange[0]!r}; choose {', '.join(WORDS)}")
        return cls(PEDALS in words, CRASH_ONLY in words)


class HighwayItself:
    """Moves the one world of a race on with an environment of highway-env."""

    def __init__(self, scenarios: Sequence[Scenario], options: ItselfOptions) -> None:
        """Make the environment.

        Raises:
            ScenarioError: highway-env is not installed, or it has no such course.
        """
        scenario = scenarios[0]
        self.similar = Similarity.of(scenario.vehicles)
        course = scenario.course
        its_own = course.name.startswith(PREFIX)
        if len(scenarios) > 1 or not its_own or parts_of(course.name)[1] != self.similar.length:
            raise ScenarioError(
                f"course {course.name!r}: {NAME} has {PREFIX}racetrack-v0 and the like alone, "
                "with :tenth for model cars"
            )
        self.options = options
        self._course = course
        action = {"type": "ContinuousAction", "longitudinal": options.pedals, "lateral": True}
        config = {
            "other_vehicles": scenario.karts - 1,
            "action": action,
            "terminate_off_road": not options.crash_only,
        }
        self.env = make_highway(parts_of(course.name)[0], **config).unwrapped
        self.step_ticks = ticks_in(DECISION_S, self.similar)
        self._ended: Retirement | None = None  # how its episode has ended
        self._targets: list[Floats] = []  # of the karts, at the end of its decision
        self._left = 0  # ticks until then

    def __call__(self, world: World, controls: Floats, ticks: int) -> None:
        """Move the world on by `ticks` ticks under the same controls, (1, K, 4).

        It decides in its own time, five times a second there, by what is asked for then.

        Raises:
            ScenarioError: there are several worlds.
        """
        if len(world.bodies) != 1:
            raise ScenarioError(f"{len(world.bodies)} worlds: {NAME} has one; give one")
        if int(world.races[0].tick) == 0:
            self._begin(world)
        take_controls(world.bodies[0], controls[0])
        for _ in range(ticks):
            if self._left == 0:
                self._decide(world)
            for k, target in enumerate(self._targets):
                shift(world.bodies[0, k], _way(world.bodies[0, k], target) / self._left)
            advance_world(world, 0, controls[0], 1)
            self._left -= 1
            if self._left > 0:
                continue
            for k, target in enumerate(self._targets):
                shift(world.bodies[0, k], _way(world.bodies[0, k], target))
            if self._ended is not None:
                retire(world, 0, 0, self._ended)

    def _decide(self, world: World) -> None:
        """Let it take one decision: where it ends is made for in the ticks that follow."""
        if self._ended is None:
            body, vehicle = world.bodies[0, 0], world.vehicles[0, 0]
            *_, over, cut, _ = self.env.step(self._action(body, vehicle))
            if over or cut:
                self._ended = Retirement.CRASH if over else Retirement.TIME_OUT
        self._targets, self._left = self._places(world), self.step_ticks

    def _begin(self, world: World) -> None:
        """Begin an episode there, and put every kart where its vehicle stands."""
        self.env.reset(seed=int(world.races[0].seed) % 2**31)
        self._ended, self._left = None, 0
        line, spacing = self._course.line, self._course.spacing
        for k, target in enumerate(self._places(world)):
            body, racer = world.bodies[0, k], world.racers[0, k]
            shift(body, _way(body, target))
            away = np.hypot(line[:, 0] - body.x, line[:, 1] - body.y)
            racer.line_index = int(away.argmin())
            racer.progress = racer.line_index * spacing

    def _vehicles(self) -> list[Any]:
        return [self.env.vehicle, *(v for v in self.env.road.vehicles if v is not self.env.vehicle)]

    def _places(self, world: World) -> list[Floats]:
        """Return x, y [m] and heading of each kart there, (3,), and set what else is known."""
        vehicles, places = self._vehicles(), []
        for k in range(world.bodies.shape[1]):
            body, vehicle = world.bodies[0, k], world.vehicles[0, k]
            if k >= len(vehicles):
                body.status = codes.ABSENT
                places.append(np.array([body.x, body.y, body.heading]))
                continue
            body.trust = codes.ELSEWHERE
            places.append(take_from(body, vehicle, vehicles[k], self.similar))
        return places

    def _action(self, body: Record, vehicle: Record) -> Floats:
        """Return its action: a steering angle of equal curvature, and with pedals acceleration."""
        target = float(body.steering_command * vehicle.steering_limit)
        wheelbase = self.similar.length * float(vehicle.front_axle + vehicle.rear_axle)
        angle = math.atan(math.tan(target) * float(self.env.vehicle.LENGTH) / wheelbase)
        body.steering = target
        steering = angle / STEERING
        if not self.options.pedals:
            return np.array([steering])
        gain = pedal_gain(body, vehicle, self.step_ticks * TICK_S)
        return np.array([gain / ACCELERATION, steering])


def _way(body: Record, target: Floats) -> Floats:
    """Return what is left to a place: x, y [m] and heading, (3,)."""
    turn = wrap_angle(float(target[2]) - float(body.heading))
    return np.array([target[0] - body.x, target[1] - body.y, turn])
