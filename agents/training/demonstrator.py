"""Record observations and controls of a driver in laps of a trial."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from race_agents.training.demonstrations import About, Demonstrations
from race_server.competition.time_trial.gaps import DECISION_S
from race_server.competition.time_trial.run import Run, drive_run, numbers_of
from race_server.competition.time_trial.run_spec import RunSpec
from race_server.core.driver import Briefing, Driver, driver_named
from race_server.core.messages import Button, Control
from race_server.core.observation import PRESETS, Observation, layout_of
from race_server.errors import ScenarioError
from race_server.scenario.sensors import Lidar

EVERYTHING = "full"


class Watched:
    """Wraps a driver, and records all observations and the driver's controls.

    With noise the kart deviates from what the driver wants, so that its corrections are recorded,
    too: Laskey et al., "DART", CoRL 2017, https://arxiv.org/abs/1703.09327
    """

    preset = EVERYTHING

    def __init__(self, driver: Driver, noise: float, seed: int) -> None:
        """Wrap a driver. noise: standard deviation of pedals and steering, as a share."""
        self.observations: list[np.ndarray] = []
        self.controls: list[np.ndarray] = []
        self.driver = driver
        self._noise = noise
        self._chance = np.random.default_rng(seed)

    def reset(self, briefing: Briefing) -> None:
        """Get ready for a new race."""
        self.driver.reset(replace(briefing, preset=self.driver.preset))

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""
        offered = observation.layout.slices
        rays = offered["lidar"].stop - offered["lidar"].start
        layout = layout_of(self.driver.preset, rays)
        values = np.concatenate([observation[part] for part in layout.slices])
        control = self.driver.act(Observation(observation.tick, layout, values))
        numbers = numbers_of(control)
        self.observations.append(observation.values.copy())
        self.controls.append(numbers)
        aside = self._chance.normal(0.0, self._noise, 2) if self._noise > 0.0 else np.zeros(2)
        steering, drive = np.clip(numbers[:2] + aside, -1.0, 1.0).tolist()
        # A driver that brakes does not press the other pedal as well.
        throttle = drive if numbers[2] == 0.0 else float(numbers[1])
        return Control(steering, throttle, float(numbers[2]), Button(int(numbers[3])))


def _as_is(driver: Driver, _: str) -> Driver:
    return driver


def demonstrate(
    driver: str, tracks: Sequence[str], vehicle: str, laps: int, seed: int, noise: float
) -> tuple[Demonstrations, list[Run]]:
    """Return demonstrations of a driver on some tracks, and its runs.

    Raises:
        RaceError: there is no such driver, track or vehicle.
        ScenarioError: the driver did not drive to the end.
    """
    runs: list[Run] = []
    shown: list[Watched] = []
    for track in tracks:
        spec = RunSpec(driver, track, vehicle, seed=seed, laps=laps)
        watched = Watched(driver_named(driver), noise, seed)
        run = drive_run(spec, make=partial(_as_is, watched))
        if run.remark:
            raise ScenarioError(f"{driver} on {track}: {run.remark}; nothing was recorded")
        runs.append(run)
        shown.append(watched)
    about = About(
        driver=driver,
        tracks=tuple(tracks),
        vehicle=vehicle,
        parts=PRESETS[EVERYTHING],
        lidar_rays=Lidar().rays,
        lidar_field=Lidar().field,
        lidar_reach=Lidar().reach,
        decision_s=DECISION_S,
    )
    observations = np.concatenate([one.observations for one in shown]).astype(np.float32)
    controls = np.concatenate([one.controls for one in shown]).astype(np.float32)
    return Demonstrations(about, observations, controls), runs
