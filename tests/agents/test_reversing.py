"""Controllers that reverse a trailer, against what they promise in closed form."""

import math
from dataclasses import replace
from functools import cache

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from race_agents.planning.reversing import (
    ANGLE_GAIN,
    TURN_GAIN,
    angle_towards,
    curvature_towards,
)
from race_server.core.free_space.rig import (
    Rig,
    Towed,
    angle_rate,
    moved,
    pose_ahead,
    rig_of,
    scale_of,
    touching_angle,
    towed_by,
    way_behind,
)
from race_server.core.kernels.geometry import Pose
from race_server.core.vehicle_presets import (
    CAR,
    CAR_TRAILER,
    KART_CART,
    LORRY,
    LORRY_OFF_AXLE,
    vehicle_named,
)
from race_server.errors import PlanError

VEHICLES = (LORRY, LORRY_OFF_AXLE, CAR_TRAILER, KART_CART)
NAMES = sorted(vehicle.name for vehicle in VEHICLES)
STEP = 0.01


@cache
def loose_rig(name: str = LORRY.name) -> Rig:
    return rig_of(vehicle_named(name), 0.0, 1.0)


def reverse(rig: Rig, towed: Towed, way: float, wanted: float | None = None) -> Towed:
    """Drive a way back with the wheels free to turn; on the x axis where no angle is wanted."""
    for _ in range(round(way / STEP)):
        angle = wanted
        if angle is None:
            angle = angle_towards(rig, towed.y, towed.heading, 0.0, -1.0)
        curvature = curvature_towards(rig, towed.angle, angle, 0.0, -1.0)
        towed = moved(rig, towed, curvature, -STEP)
    return towed


@pytest.mark.parametrize("sharp", [0.9, -0.9])
def test_a_way_through_a_sharper_angle_than_a_controller_asks_for_is_kept_to(sharp: float) -> None:
    rig = loose_rig(CAR_TRAILER.name)
    assert rig.sharpest < abs(sharp) < rig.limit
    assert angle_towards(rig, 0.0, 0.0, sharp, -1.0) == pytest.approx(sharp)
    # Far off the way it asks for no more than that, and to the other side for its own sharpest.
    asked = [
        angle_towards(rig, offset, turn, sharp, -1.0) for offset in (9, -9) for turn in (3, -3)
    ]
    side = math.copysign(1.0, sharp)
    assert max(side * angle for angle in asked) == pytest.approx(abs(sharp))
    assert min(side * angle for angle in asked) == pytest.approx(-rig.sharpest)


@given(st.sampled_from(NAMES), st.floats(-0.7, 0.7), st.floats(-0.7, 0.7), st.booleans())
@settings(max_examples=100, deadline=None)
def test_the_angles_error_decays_at_the_gains_rate_forward_and_back(
    name: str, angle: float, wanted: float, is_back: bool
) -> None:
    rig, way = loose_rig(name), -1.0 if is_back else 1.0
    rate = way * angle_rate(rig, angle, curvature_towards(rig, angle, wanted, 0.0, way))
    assert rate == pytest.approx(ANGLE_GAIN * 7.7 / rig.bar * (wanted - angle), abs=1e-9)


def test_reversing_a_lorry_a_metre_leaves_the_error_by_e_smaller() -> None:
    towed = reverse(loose_rig(), Towed(0.0, 0.0, 0.0, 0.3, 0.0), 1.0, 0.1)
    # Held for a centimetre each time: a share of half of that is missing.
    assert towed.angle - 0.1 == pytest.approx(0.2 / math.e, rel=0.01)


def test_a_held_angle_leads_the_trailer_round_a_circle_of_the_bar_by_its_tangent() -> None:
    # A fifth wheel above the axle: 7.7 m / tan 0.5 rad = 14.09 m.
    rig = loose_rig()._replace(hitch=0.0)
    towed = reverse(rig, Towed(0.0, 0.0, 0.0, 0.5, 0.0), 14.09 / math.cos(0.5), 0.5)
    assert towed.heading == pytest.approx(-1.0, abs=0.002)
    assert (towed.x, towed.y) == pytest.approx(
        (-14.09 * math.sin(1.0), 14.09 * (1.0 - math.cos(1.0))), abs=0.03
    )


@given(st.floats(-0.25, 0.25), st.sampled_from((-1.0, 1.0)))
@settings(max_examples=100, deadline=None)
def test_on_the_line_a_slant_decays_at_the_gains_rate(turn: float, way: float) -> None:
    angle = angle_towards(loose_rig(), 0.0, turn, 0.0, way)
    # The trailer turns by tan(angle) / bar on a metre of its axle ahead.
    assert way * math.tan(angle) / 7.7 == pytest.approx(-TURN_GAIN * turn, abs=1e-12)


@pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda vehicle: vehicle.name)
@pytest.mark.parametrize("offset", [-0.2, 0.2])
def test_a_trailer_reversed_for_six_bars_stands_on_the_line(vehicle: object, offset: float) -> None:
    rig = loose_rig(vehicle.name)  # type: ignore[attr-defined]
    towed = reverse(rig, Towed(0.0, offset * rig.bar, 0.1, 0.0, 0.0), 6.0 * rig.bar)
    # Both roots of r² + 0.35 r + 0.0525 have the real part -0.175 /m: e^-8 is left of 1.5 m.
    assert abs(towed.y) < 0.004 * rig.bar
    assert abs(towed.heading) < 0.004
    assert abs(towed.angle) < 0.01


def test_where_the_trailer_stands_is_known_from_the_vehicle_and_back() -> None:
    pose = Pose(3.0, -2.0, 0.7)
    for rig in map(loose_rig, NAMES):
        assert pose_ahead(rig, towed_by(rig, pose, 0.4, 0.0)) == pytest.approx(pose)
    # In line on the x axis: 0.60 m ahead of the rear axle, then 7.70 m back.
    towed = towed_by(loose_rig(), Pose(0.0, 0.0, 0.0), 0.0, 0.0)
    assert towed[:3] == pytest.approx((-7.1, 0.0, 0.0))


def test_the_trailers_axle_moves_as_the_hitch_draws_it() -> None:
    towed = Towed(0.0, 0.0, 0.0, 0.4, 0.0)
    for rig in map(loose_rig, NAMES):
        after = moved(rig, towed, 0.1, 1e-4)
        assert after.x / 1e-4 == pytest.approx(way_behind(rig, 0.4, 0.1), rel=1e-4)
        assert abs(after.y) < 1e-8


def test_a_trailer_behind_a_drawbar_touches_what_draws_it_and_a_semitrailer_does_not() -> None:
    assert touching_angle(LORRY) == LORRY.trailers[0].limit
    # The kart ends 0.158 m behind the ball, a cart with a short drawbar begins 0.30 m behind it.
    # Its corner, 0.626 m from the ball and 61.4 degrees aside, meets the kart's rear at 75.4.
    near = replace(KART_CART, trailers=(replace(KART_CART.trailers[0], ahead=-0.30),))
    assert math.degrees(touching_angle(near)) == pytest.approx(14.0, abs=0.4)


def test_a_way_is_planned_for_just_one_trailer() -> None:
    with pytest.raises(PlanError, match="'car' draws 0 trailers: a way is planned for"):
        rig_of(CAR, 0.0, 1.0)


def test_lengths_are_in_proportion_to_the_bar() -> None:
    assert scale_of(7.7) == 1.0
    assert scale_of(1.2) == pytest.approx(0.156, abs=1e-3)
