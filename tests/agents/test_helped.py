"""Help with the pedals of a real kart: what its driver does, and what comes of it."""

from dataclasses import replace

import numpy as np
import pytest

from race_agents.onboard.helped import HelpedDriver
from race_agents.onboard.program import KnownKart
from race_agents.unit.records import Report
from race_server.coaching.assistance import Guide, Level
from race_server.core.driver import Briefing
from race_server.core.messages import Control, Flag, Pose, Trust
from race_server.core.observation import Observation, layout_of
from race_server.core.vehicle_presets import KART_60
from race_server.net.wire.drive import EFFECT, HudFrame
from race_server.net.wire.line import LineSheet

# A circle of radius 20 m at 10 m/s: its only speed, so that all of it is allowed.
TURN = 2.0 * np.pi * np.arange(120) / 120
LINE = LineSheet(np.pi / 3.0, 20.0 * np.cos(TURN), 20.0 * np.sin(TURN), np.full(120, 10.0))
HUD = HudFrame(1, 60, 99.0, 1.0, 1.0, 0, 0.0, np.zeros(0, EFFECT), valid_s=0.5)
LAYOUT = layout_of("track", 0)
FULL = Control(steering=0.1, throttle=1.0)


class FootDown:
    """Drives at full throttle, wherever it is."""

    preset = "track"

    def reset(self, briefing: Briefing) -> None:
        pass

    def act(self, observation: Observation) -> Control:
        return FULL


def helped(
    speed: float,
    level: Level = Level.PEDALS,
    hud: HudFrame | None = HUD,
    now_s: float = 0.0,
    *,
    finished: bool = False,
) -> Control:
    """Return what a kart at the east of the circle, that drives north, does."""
    pose = Pose(0, 20.0, 0.0, 0.5 * np.pi, speed)
    kart = KnownKart(KART_60, hud, 0.0, Report(pose))
    driver = HelpedDriver(FootDown(), level, Guide(LINE), kart, lambda: now_s)
    values = np.zeros(LAYOUT.size, np.float32)
    values[LAYOUT.slices["finished"]] = finished
    return driver.act(Observation(0, LAYOUT, values))


def test_a_kart_that_is_too_fast_is_braked_though_its_driver_keeps_the_foot_down() -> None:
    # 5 % too fast: half of what full brakes are for.
    for level in (Level.BRAKES, Level.PEDALS):
        control = helped(10.5, level)
        assert (control.throttle, control.brake) == (0.0, pytest.approx(0.5))
        assert control.steering == FULL.steering


def test_below_the_speed_of_the_line_one_level_leaves_the_throttle_and_one_doses_it() -> None:
    assert helped(9.6, Level.BRAKES) == FULL
    assert helped(9.6, Level.PEDALS).throttle == pytest.approx(0.4)


@pytest.mark.parametrize(
    "hud",
    [
        None,
        replace(HUD, lights_s=2.0),
        replace(HUD, flag=Flag.RED),
        replace(HUD, trust=Trust.SUSPENDED),
    ],
)
def test_before_the_start_and_out_of_the_race_the_driver_is_alone(hud: HudFrame | None) -> None:
    assert helped(12.0, hud=hud) == FULL


def test_a_kart_that_is_home_or_hears_nothing_is_not_helped() -> None:
    assert helped(12.0, finished=True) == FULL
    assert helped(12.0, now_s=1.5) == FULL
    assert helped(12.0, now_s=0.5) != FULL


def test_a_limit_of_the_race_is_kept() -> None:
    assert helped(6.0, hud=replace(HUD, speed_cap=5.0)).brake == pytest.approx(1.0)
