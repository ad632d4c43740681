"""A policy that drives on the line gets free where it is stuck, as the drivers on the line do."""

import numpy as np
import pytest

from race_agents.planning.line_policy import foresee_for_all, remember_for_all
from race_agents.planning.traffic import NOWHERE
from race_server.core.driver import Briefing
from race_server.core.kernel_driver import cockpit_for
from race_server.core.observation import AHEAD, layout_of
from race_server.core.state import Floats
from race_server.core.vehicle_presets import TT02
from race_server.core.vehicles import GRAVITY
from support.cockpits import alone

DECISION_S = 0.05
LINE_STEP = 0.2  # [m]


def commands(answer: list[float], decisions: int, **seen: float) -> Floats:
    """Return what a kart is told after each decision on a straight line, shape (decisions, 4).

    seen: first numbers of parts of its observation.
    """
    layout = layout_of("line", 0)
    cockpit = cockpit_for(Briefing(0, TT02, 3, "line", DECISION_S, ()), layout)
    cockpit.observation[layout.slices["line_step"]] = LINE_STEP
    cockpit.observation[layout.slices["line_ahead_x"]] = LINE_STEP * np.arange(AHEAD)
    cockpit.observation[layout.slices["karts_x"]] = NOWHERE
    for name, value in seen.items():
        cockpit.observation[layout.slices[name].start] = value
    cockpits = alone(cockpit)
    told = np.zeros((decisions, 4))
    for row in told:
        cockpit.control[:] = answer
        remember_for_all(cockpits)
        row[:] = cockpit.control
    return told


def test_after_standing_for_0_6_s_it_backs_out_with_its_wheels_turned_the_other_way() -> None:
    told = commands([0.5, 1.0, 0.0, 0.0], 20)
    assert (told[:12, 1] == 1.0).all()
    assert told[14, :3].tolist() == [-1.0, -1.0, 0.0]


def test_after_its_second_attempt_it_goes_back_to_its_line_whatever_the_network_says() -> None:
    """A metre left of a straight line; it backs out for 0.6 s, then for 0.8 s."""
    told = commands([0.5, 1.0, 0.0, 2.0], 60, line_offset=1.0, line_speed_ahead=3.0)
    assert told[26, 0] == 0.5
    assert told[40:52, 1].tolist() == [-1.0] * 12
    assert told[56, 0] < 0.0 < told[56, 1]
    assert (told[:, 3] == 2.0).all()


def test_the_button_that_it_holds_stays_down_meanwhile() -> None:
    assert (commands([0.5, 1.0, 0.0, 2.0], 20)[:, 3] == 2.0).all()


@pytest.mark.parametrize("name", ["lights", "finished"])
def test_before_the_start_and_after_the_finish_it_stands_for_as_long_as_it_takes(name: str) -> None:
    told = commands([0.0, 0.0, 1.0, 0.0], 100, **{name: 1.0})
    assert (told[:, 1] == 0.0).all()
    assert (told[:, 2] == 1.0).all()


@pytest.mark.parametrize(
    ("speed", "share_of_grip", "shown"),
    [(9.0, 1.0, 8.73), (9.0, 0.5, 8.865), (9.0, 0.0, 9.0), (4.0, 1.0, 4.0)],
)
def test_fast_bends_are_shown_up_to_3_percent_slower(
    speed: float, share_of_grip: float, shown: float
) -> None:
    """The top speed is 10 m/s: from 4 m/s on a little, from 7 m/s on by 3 %."""
    bend = share_of_grip * TT02.grip * GRAVITY / speed**2
    assert speed_shown(np.full(AHEAD, speed), -bend) == pytest.approx(shown)


@pytest.mark.parametrize(("share_of_grip", "shown"), [(1.0, 8.73), (0.5, 8.865), (-0.5, 9.0)])
def test_so_is_braking_on_a_straight_but_not_its_opposite(
    share_of_grip: float, shown: float
) -> None:
    """From 9 m/s on: the square of a speed falls by twice the braking times the way."""
    way = LINE_STEP * np.arange(AHEAD)
    squares = 9.0**2 - 2.0 * share_of_grip * TT02.grip * GRAVITY * way
    assert speed_shown(np.sqrt(np.maximum(squares, 0.0)), 0.0) == pytest.approx(shown)


def speed_shown(speeds: Floats, bend: float) -> float:
    """Return the first of the line's speeds, (AHEAD,) [m/s], as shown to a policy. bend: [1/m]."""
    layout = layout_of("line", 0)
    cockpit = cockpit_for(Briefing(0, TT02, 3, "line", DECISION_S, ()), layout)
    seen = {"line_curvature_ahead": bend, "line_step": LINE_STEP, "karts_x": NOWHERE}
    room = {"line_left_ahead": 1.0, "line_right_ahead": 1.0}
    for name, value in (seen | room).items():
        cockpit.observation[layout.slices[name]] = value
    cockpit.observation[layout.slices["line_speed_ahead"]] = speeds
    foresee_for_all(alone(cockpit))
    return float(cockpit.observation[layout.slices["line_speed_ahead"].start])


def test_a_kart_that_drives_does_what_the_network_says() -> None:
    told = commands([0.5, 1.0, 0.0, 0.0], 100, speed=2.0)
    assert (told[:, 1] == 1.0).all()
    assert told[-1, 0] == pytest.approx(0.5)


def test_a_network_that_is_turned_round_may_turn_back_as_it_knows() -> None:
    told = commands([-1.0, 1.0, 0.0, 0.0], 100, wrong_way=1.0)
    assert (told[:, 1] == 1.0).all()


def test_behind_a_kart_that_stands_it_waits_for_2_8_s() -> None:
    # Of each 0.05 s behind it four fifths do not count.
    told = commands([0.0, 1.0, 0.0, 0.0], 80, karts_x=TT02.length + 0.1)
    assert (told[:56, 1] == 1.0).all()
    assert told[57, 1] == -1.0
