"""Demonstrations of parking, driven by a planner where the report used a keyboard."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from race_agents.training.demonstrations import About, Demonstrations, write_demonstrations
from race_agents.training.demonstrator import EVERYTHING, Watched
from race_agents.training.settings import Settings
from race_agents.training.tasks import courses_of, evaluation_tasks
from race_server.competition.time_trial.run import numbers_of
from race_server.core.driver import Briefing, driver_named, tell_to_park
from race_server.core.observation import PRESETS, Observation
from race_server.core.parking_order import ParkingOrder, order_of
from race_server.envs.batch import Batch
from race_server.envs.reality_gap import RealityGap
from race_server.envs.task import Task
from race_server.errors import ScenarioError

DRIVER = "valet"
FIRST_SEED = 60_000  # far from those of training and exam
MOST_FAILURES = 20  # one after another


class Shown(Watched):
    """Records a driver that is told where to park."""

    def park(self, order: ParkingOrder) -> None:
        """Drive to a slot from the next observation on."""
        tell_to_park(self.driver, DRIVER, order)


@contextmanager
def imitating(settings: Settings, imitates: Sequence[str], decisions: int) -> Iterator[Settings]:
    """Give settings whose tables of these names have demonstrations; they last as long as this.

    Raises:
        RaceError: the demonstrator is not installed, or does not park.
    """
    if not imitates:
        yield settings
        return
    with TemporaryDirectory() as folder:
        path = Path(folder) / "demonstrations.npz"
        write_demonstrations(path, demonstrations_of(settings, decisions))
        shown = {"demonstrations": str(path)}
        tables = {name: getattr(settings, name).model_copy(update=shown) for name in imitates}
        yield settings.model_copy(update=tables)


def demonstrations_of(settings: Settings, decisions: int, driver: str = DRIVER) -> Demonstrations:
    """Return that many decisions of a driver in the first lot of a training, of ways that park.

    Raises:
        DriverError: the driver is unknown, or takes no order to park.
        ScenarioError: it does not park 20 times running.
    """
    lot = courses_of(settings)[0]
    task = evaluation_tasks(settings, (lot,))[lot].with_options(
        observation=EVERYTHING, action="control", gap=RealityGap()
    )
    batch = Batch(task, worlds=1)
    batch.reset(FIRST_SEED)
    ways: list[Shown] = []
    failures = 0
    while sum(len(way.controls) for way in ways) < decisions:
        way = Shown(driver_named(driver), 0.0, FIRST_SEED)
        if _drive(way, batch, _briefing_of(task, settings)):
            ways.append(way)
            failures = 0
            continue
        failures += 1
        if failures == MOST_FAILURES:
            raise ScenarioError(
                f"driver {driver!r} in {lot!r}: did not park {failures} times running, so there is "
                "nothing to imitate; choose another lot"
            )
    batch.close()
    observations = np.concatenate([way.observations for way in ways])[:decisions]
    controls = np.concatenate([way.controls for way in ways])[:decisions]
    about = _about(task, settings, driver)
    return Demonstrations(about, observations.astype(np.float32), controls.astype(np.float32))


def _drive(way: Shown, batch: Batch, briefing: Briefing) -> bool:
    """Drive the only world of a batch until its episode is over; return whether it parked."""
    way.reset(briefing)
    way.park(order_of(batch.world, 0, 0))
    while True:
        tick = int(batch.world.races[0].tick)
        seen = Observation(tick, batch.layout, batch.observations[0, 0].copy())
        batch.step(numbers_of(way.act(seen))[None, None])
        if batch.terminated[0, 0] or batch.truncated[0, 0]:
            return bool(batch.episode_of(0, 0)["is_success"])


def _briefing_of(task: Task, settings: Settings) -> Briefing:
    (scenario,) = task.scenarios
    return Briefing(
        seat=0,
        vehicle=scenario.vehicle_of(0),
        laps=0,
        preset=EVERYTHING,
        decision_s=settings.decision_s,
        lidar_field=scenario.lidar.field,
        lidar_reach=scenario.lidar.reach,
        waits=True,
    )


def _about(task: Task, settings: Settings, driver: str) -> About:
    lidar = task.scenarios[0].lidar
    return About(
        driver=driver,
        tracks=courses_of(settings)[:1],
        vehicle=settings.vehicle,
        parts=PRESETS[EVERYTHING],
        lidar_rays=lidar.rays,
        lidar_field=lidar.field,
        lidar_reach=lidar.reach,
        decision_s=settings.decision_s,
    )
