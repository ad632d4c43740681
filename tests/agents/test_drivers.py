"""The scripted drivers on a small ring."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest

from race_agents.drivers.avoider import avoid
from race_agents.planning.gap_way import middle_of_gap
from race_agents.planning.scan import fill_dropouts, smooth_walls, widen_edges
from race_agents.planning.tracking import spare_rear
from race_server.core.driver import Briefing, driver_named, driver_names
from race_server.core.kernel_driver import cockpit_for
from race_server.core.messages import EventKind, Status
from race_server.core.observation import layout_of
from race_server.core.vehicle_presets import KART_60, TT02
from race_server.core.vehicles import GRAVITY, Vehicle, vehicle_record
from race_server.errors import DriverError
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.raceline.attach import with_line
from support.courses import SMALL_RING
from support.races import run_race

DRIVERS = [
    "avoider",
    "follow_gap",
    "idm",
    "pure_pursuit",
    "raceline",
    "tentacles",
    "tentacles_report_b",
]


def test_drivers_are_found_by_their_names() -> None:
    assert {*DRIVERS, "unstuck"} <= set(driver_names())


def test_an_unknown_driver_is_named_with_the_known_ones() -> None:
    with pytest.raises(DriverError, match="'schumacher' is unknown; installed drivers are"):
        driver_named("schumacher")


@pytest.mark.parametrize("name", DRIVERS)
def test_alone_each_driver_laps_without_touching_a_wall(name: str) -> None:
    scenario = Scenario(SMALL_RING, karts=1, rules=Rules(laps=2, items=False, limit_s=120.0))
    scenario = with_line(scenario)
    session, _ = run_race(scenario, [name])
    body, racer = session.world.bodies[0, 0], session.world.racers[0, 0]
    assert body.status == Status.FINISHED
    assert racer.wall_contacts == 0


def test_six_mixed_drivers_race_to_the_end_with_items() -> None:
    names = ["pure_pursuit", "follow_gap", "avoider"] * 2
    scenario = Scenario(SMALL_RING, karts=6, seed=7, rules=Rules(laps=2, limit_s=180.0))
    session, events = run_race(scenario, names)
    assert {row.status for row in session.standings()} == {Status.FINISHED}
    assert EventKind.USE in [event.kind for event in events]


def test_the_same_race_gives_the_same_digest_again() -> None:
    names = ["follow_gap", "pure_pursuit"]
    scenario = Scenario(SMALL_RING, karts=2, seed=3, rules=Rules(laps=1))
    assert run_race(scenario, names)[0].digest() == run_race(scenario, names)[0].digest()


def test_before_a_wall_the_avoider_turns_to_where_it_is_deeper_beside_it() -> None:
    layout = layout_of("lidar", 201)
    cockpit = cockpit_for(Briefing(0, TT02, 3, "lidar", 0.05, (), math.radians(200.0), 8.0), layout)
    # A wall at 1 m all round, but for an opening from 80° to 100° on the right.
    start = layout.slices["lidar"].start
    for ray in range(201):
        cockpit.observation[start + ray] = 3.0 if ray <= 20 else 1.0
    avoid(cockpit)
    assert cockpit.control[0] == -1.0


def brake_left(vehicle: Vehicle, turning: float) -> float:
    """Return what is left of the full brake on dry asphalt."""
    control = np.array([0.0, 0.0, 1.0, 0.0])
    spare_rear(vehicle_record(vehicle)[0], vehicle.grip * GRAVITY, turning, control)
    return float(control[2])


def test_a_kart_brakes_no_harder_than_its_rear_tyres_hold() -> None:
    # 60 % of the load and 70 % of the brakes are at the rear, so that 0.95 · 0.6 / 0.7 of the grip
    # of 0.89 is left of brakes for 0.75; in a bend that takes 0.75 of the grip less.
    assert brake_left(KART_60, 0.0) == pytest.approx(0.95 * 0.6 / 0.7 * 0.89 / 0.75, rel=0.01)
    bend = math.sqrt(0.95**2 - 0.75**2) / 0.95
    assert brake_left(KART_60, 0.75) == pytest.approx(bend * brake_left(KART_60, 0.0))
    assert brake_left(TT02, 0.75) == 1.0  # brakes all four wheels alike


def repaired(ranges: list[float], reach: float) -> list[float]:
    out = np.zeros(len(ranges))
    fill_dropouts(np.array(ranges), 0, len(ranges), reach, out, 0)
    return list(out)


def test_a_drop_out_takes_the_value_between_its_neighbours() -> None:
    assert repaired([0.0, 1.0, 0.0, 0.0, 4.0, 0.0], 8.0) == [1.0, 1.0, 2.0, 3.0, 4.0, 4.0]


def test_a_dead_lidar_reads_as_free() -> None:
    assert repaired([0.0, 0.0], 8.0) == [8.0, 8.0]


def test_an_edge_hides_the_space_beside_it() -> None:
    ranges = np.array([1.0, 1.0, 5.0, 5.0, 5.0, 5.0])
    wide = np.zeros(6)
    # Half a width of 0.2 m at 1 m is 0.2 rad: two steps of 0.1 rad and one to be safe.
    widen_edges(ranges, 0, 6, 0.1, 0.2, 0.5, wide, 0)
    assert list(wide) == [1.0, 1.0, 1.0, 1.0, 1.0, 5.0]


def smoothed(ranges: list[float]) -> list[float]:
    scan = np.array([*ranges, *ranges])
    smooth_walls(scan, 0, len(ranges), 0.5)
    return list(scan[: len(ranges)])


def test_a_straight_wall_stays_where_it_is_when_ranges_are_smoothed() -> None:
    wall = [2.0 / math.cos(math.radians(angle)) for angle in range(-40, 41)]
    assert smoothed(wall) == pytest.approx(wall, rel=0.001)


def test_of_noise_on_a_wall_a_fifth_is_left() -> None:
    noisy = [2.03, 1.97] * 6
    assert max(abs(distance - 2.0) for distance in smoothed(noisy)[2:-2]) < 0.007


def test_an_edge_stays_as_sharp_as_it_was_seen() -> None:
    edge = [1.0, 1.0, 1.0, 1.0, 5.0, 5.0, 5.0, 5.0]
    assert smoothed(edge) == pytest.approx(edge)


def test_the_widest_deep_stretch_is_the_gap() -> None:
    # Rays at -40°, -20° … 40°; deep are -40° alone and 0° to 20°.
    free = np.array([5.0, 1.0, 5.0, 5.0, 1.0])
    angle = middle_of_gap(free, 0, 5, math.radians(80.0), 4.0)
    assert math.degrees(angle) == pytest.approx(10.0)


@pytest.mark.parametrize("name", DRIVERS)
def test_a_driver_decides_alike_compiled_and_interpreted(name: str) -> None:
    decisions = {mode: decisions_of(name, mode) for mode in ("0", "1")}
    assert decisions["0"] == decisions["1"]
    assert len(set(decisions["0"])) > 10


def decisions_of(name: str, interpret: str) -> list[str]:
    code = f"""
import numpy as np
from race_server.core.driver import Briefing, driver_named
from race_server.core.observation import Observation, layout_of
from race_server.core.vehicle_presets import TT02
driver = driver_named({name!r})
layout = layout_of(driver.preset, 41)
driver.reset(Briefing(0, TT02, 3, driver.preset, 0.05, ("boost", "oil"), 3.4))
chance = np.random.default_rng(1)
low, high = np.maximum(layout.lows(), -3.0), np.minimum(layout.highs(), 3.0)
for tick in range(40):
    values = chance.uniform(low, high).astype(np.float32)
    values[layout.slices["lights"]] = values[layout.slices["finished"]] = 0.0
    values[layout.slices["wrong_way"]] = 0.0
    if "look_ahead" in layout.slices:
        values[layout.slices["look_ahead"]] = 0.5
    if "line_step" in layout.slices:
        values[layout.slices["line_step"]] = 0.2
    control = driver.act(Observation(tick, layout, values))
    print(control.steering.hex(), control.throttle.hex(), control.brake.hex(), control.buttons)
"""
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "RACE_SERVER_INTERPRET": interpret},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()
