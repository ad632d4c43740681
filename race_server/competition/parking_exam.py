"""The exam of parking: a driver, and one task after another, each decided by its seed.

Many tasks are driven side by side, each in a world of one batch.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from race_server.competition.time_trial.run import numbers_of
from race_server.core.clock import TICK_S
from race_server.core.driver import Briefing, Driver, driver_named, tell_to_park
from race_server.core.observation import Observation
from race_server.core.parking_order import ParkingOrder, order_of
from race_server.core.seeds import HELD_OUT
from race_server.core.state import Float32s, Floats
from race_server.envs.batch import Batch
from race_server.envs.parking import Parking
from race_server.envs.reality_gap import MOST_DELAY, RealityGap
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.scenario.lot.load import load_lot
from race_server.scenario.parking import parking_scenario
from race_server.scenario.race import Scenario

# Those of the report on automatic parking of a kart, 2022.
SCENARIOS = {"1": "zone-30", "2": "yard-70"}
DECISION_TICKS = 6
DECISION_S = DECISION_TICKS * TICK_S
# Tasks that are driven side by side.
SIDE_BY_SIDE = 64
# How an episode ends whose driver raised an exception, and how much is told of that [characters].
FAULT, MOST_WORDS = "driver", 200
BRAKE = np.array([0.0, 0.0, 1.0, 0.0], np.float32)


@dataclass(frozen=True)
class ExamSpec:
    """What is asked of every driver. Empty or zero: as the lot says."""

    scenario: str  # a name of SCENARIOS, or of a lot
    seeds: Sequence[int] = range(HELD_OUT + 1, HELD_OUT + 1001)
    vehicle: str = ""
    level: str = ""
    limit_s: float = 0.0
    delay_s: float = 0.0  # from an answer to its effect
    noise: float = 0.0  # [m] of the ranges of radar and lidar, one standard deviation
    gap: RealityGap = field(default_factory=RealityGap)  # but for the delay

    @property
    def lot(self) -> str:
        """The name of the lot."""
        return SCENARIOS.get(self.scenario, self.scenario)

    @property
    def level_name(self) -> str:
        """The name of the level, the lot's unless another is asked for."""
        lot = load_lot(self.lot).lot
        return self.level or (lot.level if lot is not None else "")

    def scenario_of(self) -> Scenario:
        """Return the scenario of all tasks.

        Raises:
            LotError, VehicleError, ScenarioError: a name is unknown.
        """
        scenario = parking_scenario(
            self.lot, vehicle=self.vehicle, level=self.level, limit_s=self.limit_s
        )
        radar, lidar = scenario.radar, scenario.lidar
        return replace(
            scenario,
            radar=replace(radar, noise=self.noise),
            lidar=replace(lidar, noise=self.noise),
        )

    def task_of(self, scenario: Scenario, preset: str) -> Task:
        """Return the task of a driver that observes a preset.

        Raises:
            ScenarioError: the delay is no whole number of decisions.
        """
        delay = round(self.delay_s / DECISION_S)
        if abs(delay * DECISION_S - self.delay_s) > 1e-6 or not 0 <= delay <= MOST_DELAY:
            raise ScenarioError(
                f"delay {self.delay_s:g} s: drivers decide every {DECISION_S:g} s, choose a "
                f"multiple of that up to {MOST_DELAY * DECISION_S:g} s"
            )
        return Task(
            (scenario,),
            Parking(),
            observation=preset,
            action="control",
            reward="park",
            gap=replace(self.gap, action_delay=(float(delay), float(delay))),
            decision_ticks=DECISION_TICKS,
        )


@dataclass(frozen=True, eq=False)
class Try:
    """How a driver did in one task."""

    seed: int
    figures: dict[str, Any]  # see `race_server/envs/parking/discipline.py:Parking.report`
    order: ParkingOrder
    start: Floats  # (3,) x [m], y [m], heading [rad] of the centre of gravity
    end: Floats  # (3,) the same at the last decision
    fault: str = ""  # what the driver raised


def drive_exam(
    spec: ExamSpec, name: str, make: Callable[[str], Driver] = driver_named
) -> Iterator[Try]:
    """Yield how a driver did in each task, in the order in which they end.

    Raises:
        LotError, VehicleError, ScenarioError: the exam makes no task.
        DriverError: the driver is unknown, cannot park, or not with this vehicle.
    """
    seeds = list(spec.seeds)
    if not seeds or min(seeds) < 0:
        raise ScenarioError(f"seeds {seeds[:3]}: give one or more, none below zero")
    scenario, count = spec.scenario_of(), min(SIDE_BY_SIDE, len(seeds))
    drivers = [make(name) for _ in range(count)]
    batch = Batch(spec.task_of(scenario, drivers[0].preset), worlds=count)
    try:
        yield from _Hall(batch, scenario, name, drivers, deque(seeds)).drive()
    finally:
        batch.close()


class _Hall:
    """All worlds of an exam, and their drivers."""

    def __init__(
        self,
        batch: Batch,
        scenario: Scenario,
        name: str,
        drivers: Sequence[Driver],
        waiting: deque[int],
    ) -> None:
        """Begin a task in each world. waiting: the seeds.

        Raises:
            DriverError: the driver cannot park, or not with this vehicle.
        """
        self.batch = batch
        self.name = name
        self.drivers = drivers
        self.waiting = waiting
        self.begun: dict[int, Try] = {}  # by world
        self._briefing = Briefing(
            seat=0,
            vehicle=scenario.vehicle_of(0),
            laps=0,
            preset=drivers[0].preset,
            decision_s=DECISION_S,
            lidar_field=scenario.lidar.field,
            lidar_reach=scenario.lidar.reach,
        )
        self._coming: list[int | None] = [None] * batch.worlds  # seeds of the next rounds
        for w in range(batch.worlds):
            self._let_follow(w)
        batch.reset()
        for w in range(batch.worlds):
            self._begin(w)

    def drive(self) -> Iterator[Try]:
        """Yield how each task went."""
        batch = self.batch
        while self.begun:
            places = self._places()
            for w in self.begun:
                batch.buffers.actions[w, 0] = self._answer(w)
            batch.step()
            over = batch.terminated[:, 0] | batch.truncated[:, 0]
            for w in [w for w in self.begun if over[w]]:
                yield self._outcome(w, places[w])
                self._begin(w)

    def _let_follow(self, w: int) -> None:
        """Set the seed of a world's next round."""
        self._coming[w] = self.waiting.popleft() if self.waiting else None
        self.batch.seed_next(w, self._coming[w] or 0)

    def _begin(self, w: int) -> None:
        """Take up the round that a world has just begun; behind the last seed none counts."""
        seed = self._coming[w]
        self.begun.pop(w, None)
        self.batch.buffers.actions[w, 0] = BRAKE
        if seed is None:
            return
        self._let_follow(w)
        order = order_of(self.batch.world, w, 0)
        self.drivers[w].reset(self._briefing)
        tell_to_park(self.drivers[w], self.name, order)
        self.begun[w] = Try(seed, {}, order, self._places()[w], self._places()[w])

    def _places(self) -> Floats:
        """Return where the vehicles are: (W, 3) x [m], y [m], heading [rad]."""
        bodies = self.batch.world.bodies[:, 0]
        return np.stack([bodies[name] for name in ("x", "y", "heading")], axis=1)

    def _answer(self, w: int) -> Float32s:
        """Return the control of a driver; one that raised an exception brakes."""
        task = self.begun[w]
        if task.fault:
            return BRAKE
        batch = self.batch
        # A copy, so that a driver cannot change the buffer of the world.
        seen = batch.observations[w, 0].copy()
        try:
            tick = int(batch.world.races[w].tick)
            return numbers_of(self.drivers[w].act(Observation(tick, batch.layout, seen)))
        except Exception as error:  # a driver's fault ends its task, not the exam
            words = str(error).partition("\n")[0][:MOST_WORDS]
            self.begun[w] = replace(task, fault=f"{type(error).__name__}: {words}")
            return BRAKE

    def _outcome(self, w: int, end: Floats) -> Try:
        """Return how the task of a world went. end: the place before the last decision."""
        task, figures = self.begun[w], self.batch.episode_of(w, 0)
        if task.fault:
            figures |= {"is_success": False, "aligned": False, "ending": FAULT}
        return replace(task, figures=figures, end=end)
