"""Karts beside the way, and ones that noise seems to move: which of them a kart brakes for."""

import math

import numpy as np
import pytest

from race_agents.unit.danger import danger_of
from race_agents.unit.drift import Drift
from race_agents.unit.limits import Limits
from race_agents.unit.track import Track
from race_server.core import codes
from race_server.core.alert import DangerStage
from race_server.core.vehicle_presets import KART_60

LIMITS = Limits.of(KART_60)


@pytest.mark.parametrize("kind", [codes.KART_HIT, codes.PERSON])
def test_who_crosses_the_far_side_of_a_tight_bend_is_not_met(kind: int) -> None:
    # A circle of 8 m across, to the right at 11 km/h: half of it takes 4 s.
    for ahead in np.arange(0.0, 4.0, 0.5):
        state = np.array([ahead + LIMITS.nose, -8.0, -3.0, 0.0])
        far = Track(state, 1e-4 * np.eye(4), kind, 0.2, scans=20, began=60.0)
        assert danger_of(far, 3.0, -0.25, LIMITS).stage < DangerStage.EASE


def kart_at(x: float, y: float, along: float, across: float) -> Track:
    """Return a kart whose speed [m/s] along the radar's ray is plain, and across it to 1.2 m/s."""
    cos, sin = x / math.hypot(x, y), y / math.hypot(x, y)
    turn = np.array([[cos, -sin], [sin, cos]])
    state = np.array([x + LIMITS.nose, y, *(turn @ (along, across))])
    spread = 1e-4 * np.eye(4)
    spread[2:, 2:] = turn @ np.diag([0.04, 1.2**2]) @ turn.T
    eye = LIMITS.nose, 0.0
    return Track(state, spread, codes.KART_HIT, 0.2, scans=20, began=60.0, eye=eye)


@pytest.mark.parametrize(
    ("across", "stage"),
    [(2.2, DangerStage.EASE), (0.0, DangerStage.FULL), (-2.2, DangerStage.FULL)],
)
def test_a_kart_beside_that_comes_and_seems_to_move_away_is_eased_for(
    across: float, stage: DangerStage
) -> None:
    comes = kart_at(4.0, 1.5, -4.0, across)  # 2.2 m/s are less than two deviations
    assert danger_of(comes, 5.0, 0.0, LIMITS).stage is stage


@pytest.mark.parametrize("aside", [0.0, 0.3, 0.9])
@pytest.mark.parametrize("across", [-3.3, -2.5, -1.0, 0.0, 1.0, 2.5, 3.3])
def test_a_parked_kart_that_noise_seems_to_move_across_is_braked_for(
    aside: float, across: float
) -> None:
    # As far as brakes reach at 10 m/s, straight ahead and half in the way.
    stands = kart_at(11.7, aside, 0.0, across)
    assert danger_of(stands, 10.0, 0.0, LIMITS).stage is DangerStage.FULL


@pytest.mark.parametrize(("course", "pivot"), [(0.5, 0.0), (-0.4, 0.8)])
def test_a_track_moves_as_it_did_where_arcs_begin_elsewhere(course: float, pivot: float) -> None:
    track = kart_at(3.0, -2.0, 1.5, 6.0)
    (there,) = Drift(pivot, course).tracks([track])
    cos, sin = math.cos(course), math.sin(course)
    vx, vy = there.velocity
    assert (cos * vx - sin * vy, sin * vx + cos * vy) == pytest.approx(track.velocity)
    assert there.leaves == pytest.approx(1.5)
