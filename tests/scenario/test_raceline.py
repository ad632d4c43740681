import json
import math
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from race_server.core.vehicle_presets import KART_60, TT02, TT02_FACTS, vehicle_named
from race_server.core.vehicles import Vehicle
from race_server.errors import RaceError, TrackError, VehicleError
from race_server.scenario.raceline import reference
from race_server.scenario.raceline.baselines import centre_line
from race_server.scenario.raceline.bounds import Bounds, bounds_of
from race_server.scenario.raceline.bundled import bundled_name, limits_folder, read_bundled
from race_server.scenario.raceline.export import exports
from race_server.scenario.raceline.frame import frame_of
from race_server.scenario.raceline.profile import grip_left, lap_time, speeds_on
from race_server.scenario.raceline.program import ROUGH, Program
from race_server.scenario.raceline.reference import Limit, Raceline, reference_limit
from race_server.scenario.raceline.solution import Search, fastest_of, limit_of, solve, with_room
from race_server.scenario.raceline.tyres import cornering_drag
from race_server.scenario.track.course import Course
from race_server.scenario.track.load import load_course, read_course
from race_server.scenario.track.polyline import nearest_on

LINES = ("minimum_time", "with_room", "minimum_curvature", "centre_line", "shortest")

# Minimum lap times [s] of an independent program at these speed caps [m/s].
KNOWN = {
    "oval-report": {2.5: 7.58, 3.33: 6.25, 5.0: 5.29, 8.0: 5.21},
    "covapsy-train-2023": {2.5: 11.11, 3.33: 9.35, 5.0: 8.47, 8.0: 8.47},
}
CASES = [(track, cap) for track, row in KNOWN.items() for cap in row]


@pytest.fixture(autouse=True)
def shelf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(reference, "cache_root", lambda: tmp_path)
    monkeypatch.setattr(reference, "read_bundled", lambda course, bounds: None)
    return tmp_path / "limits"


def ring(folder: Path, radius: float, half_width: float = 0.6) -> Course:
    angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    points = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    path = folder / "ring.toml"
    path.write_text(f'form = "line"\nhalf_width = {half_width}\npoints = {points.tolist()}\n')
    return read_course(path)


def grip_used(line: Raceline, bounds: Bounds) -> np.ndarray:
    """Return the share of the grip in use at each point, driving away or braking towards it."""
    losses = bounds.rolling + bounds.drag * line.speed**2
    lateral = line.speed**2 * line.curvature
    # Of the deceleration, what slip gives anyway is not asked of the brakes.
    slip = [
        cornering_drag(
            speed, curvature, -bounds.brake_grip * grip_left(speed, curvature, bounds), bounds
        )
        for speed, curvature in zip(line.speed, line.curvature, strict=True)
    ]
    away = np.maximum(line.acceleration + losses, 0.0) / bounds.drive_grip
    towards = np.maximum(-np.roll(line.acceleration, 1) - losses - slip, 0.0) / bounds.brake_grip
    away = np.where(line.acceleration > 0.0, away, 0.0)
    return np.asarray(np.hypot(lateral / bounds.lateral, np.maximum(away, towards)))


def test_a_ring_is_lapped_fastest_along_its_inner_border(tmp_path: Path) -> None:
    pytest.importorskip("casadi")
    limit = reference_limit(ring(tmp_path, 2.0), TT02_FACTS)
    inner = 2.0 - 0.6 + 0.145
    # With v² / r = 5 m/s² a lap takes 2 pi sqrt(r / 5).
    for line, radius in ((limit.minimum_time, inner), (limit.centre_line, 2.0)):
        assert line.time_s == pytest.approx(2 * math.pi * math.sqrt(radius / 5.0), rel=5e-3)
    assert limit.shortest.length == pytest.approx(2 * math.pi * inner, rel=2e-3)
    radii = np.hypot(limit.minimum_time.x, limit.minimum_time.y)
    assert np.allclose(radii, inner, atol=0.005)


def test_in_a_wide_room_the_fastest_lap_is_not_where_the_centre_line_ends(tmp_path: Path) -> None:
    pytest.importorskip("casadi")
    # Its inner border is 2.2 m from the centre line; a frame sees room to 1.2 m.
    limit = reference_limit(ring(tmp_path, 3.0, 2.2), TT02_FACTS)
    inner = 3.0 - 2.2 + 0.145
    assert limit.minimum_time.time_s == pytest.approx(
        2 * math.pi * math.sqrt(inner / 5.0), rel=5e-3
    )
    assert limit.shortest.length == pytest.approx(2 * math.pi * inner, rel=5e-3)
    # The centre line's lap is that of the centre line.
    assert limit.centre_line.time_s == pytest.approx(2 * math.pi * math.sqrt(3.0 / 5.0), rel=5e-3)


def test_the_limit_does_not_depend_on_where_the_centre_line_runs(tmp_path: Path) -> None:
    pytest.importorskip("casadi")
    straight, angles = ring(tmp_path, 2.0, 1.0), np.linspace(0.0, 2 * np.pi, 60, endpoint=False)
    points = (2.0 + 0.3 * np.sin(5.0 * angles)) * np.stack([np.cos(angles), np.sin(angles)])
    path = tmp_path / "winding.toml"
    path.write_text(f'form = "line"\nhalf_width = 0.5\npoints = {points.T.tolist()}\n')
    winding = replace(read_course(path), borders=straight.borders)
    inner = 2.0 - 1.0 + 0.145
    for course in (straight, winding):
        lap = reference_limit(course, TT02_FACTS).minimum_time
        assert lap.time_s == pytest.approx(2 * math.pi * math.sqrt(inner / 5.0), rel=5e-3)


def test_a_lap_with_room_keeps_five_centimetres_more_at_ten_metres_a_second(
    tmp_path: Path,
) -> None:
    pytest.importorskip("casadi")
    limit = reference_limit(ring(tmp_path, 15.0), TT02_FACTS)
    fastest, roomy = limit.minimum_time, limit.with_room
    speed = float(fastest.speed.mean())
    assert speed == pytest.approx(8.0, abs=0.6)
    more = np.hypot(roomy.x, roomy.y).mean() - np.hypot(fastest.x, fastest.y).mean()
    assert more == pytest.approx(0.05 * (speed / 10.0) ** 2, abs=2e-3)


def test_a_lap_with_room_leaves_half_of_what_a_narrow_course_has(tmp_path: Path) -> None:
    pytest.importorskip("casadi")
    bounds = bounds_of(TT02_FACTS)
    free = 0.02
    found = fastest_of(ring(tmp_path, 15.0, bounds.reach + free), bounds)
    lap = with_room(found, bounds).line
    assert lap.offset == pytest.approx(np.full(len(lap.offset), 0.5 * free), abs=2e-3)


@pytest.mark.parametrize("way", [0.0, 0.05, 0.1, 0.15])
def test_the_tip_of_a_wall_between_two_stations_is_seen(tmp_path: Path, way: float) -> None:
    """A post of 6 cm stands 0.1 m beside a centre line of 251 m, whose stations are 0.2 m apart."""
    course, bounds = ring(tmp_path, 40.0), bounds_of(TT02_FACTS)
    angles = np.array([-0.03, 0.03]) / 40.0 + 1.0 + way / 40.0
    inner, outer = (r * np.column_stack([np.cos(angles), np.sin(angles)]) for r in (40.1, 40.6))
    post = np.array([[*inner[0], *inner[1]], [*inner[0], *outer[0]], [*inner[1], *outer[1]]])
    free = frame_of(course, bounds)
    frame = frame_of(replace(course, borders=np.vstack([course.borders, post])), bounds)
    assert free.step > 0.2
    assert free.low == pytest.approx(np.full(len(free.low), bounds.reach - 0.6), abs=0.01)
    assert frame.low.max() == pytest.approx(bounds.reach - 0.1, abs=0.01)
    assert np.sum(frame.low > bounds.reach - 0.5) in {1, 2}


def test_a_slow_vehicle_laps_a_ring_at_its_top_speed(tmp_path: Path) -> None:
    pytest.importorskip("casadi")
    limit = reference_limit(ring(tmp_path, 2.0), TT02_FACTS, 1.5)
    assert limit.minimum_time.time_s == pytest.approx(2 * math.pi * 1.545 / 1.5, rel=2e-3)
    assert [zone.what for zone in limit.minimum_time.zones] == ["hold"]


@pytest.mark.parametrize(("track", "cap"), CASES)
def test_known_minimum_times_are_reproduced(track: str, cap: float) -> None:
    pytest.importorskip("casadi")
    limit = reference_limit(load_course(track), vehicle_named("tt02-facts"), cap)
    assert limit.minimum_time.time_s == pytest.approx(KNOWN[track][cap], rel=0.015)
    assert all(getattr(limit, name).time_s >= limit.minimum_time.time_s for name in LINES)


def test_the_oval_and_its_car_are_what_the_known_times_are_for() -> None:
    course, bounds = load_course("oval-report"), bounds_of(TT02_FACTS)
    assert course.length == pytest.approx(12.0 + 2.0 * math.pi * 1.5, rel=2e-3)
    assert np.allclose(course.half_widths, 0.6)
    assert bounds.lateral == bounds.drive_grip == bounds.brake_grip == pytest.approx(5.0)
    assert (bounds.drive, bounds.brake) == pytest.approx((3.0, 4.0))
    assert 1.0 / bounds.curvature == pytest.approx(0.70)
    assert bounds.steering_rate / bounds.wheelbase == pytest.approx(6.0)
    assert bounds.reach == pytest.approx(0.145)


@pytest.fixture(scope="module")
def kart_limit() -> Limit:
    pytest.importorskip("casadi")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reference, "known_limit", lambda course, bounds: None)
        patch.setattr(reference, "_write", lambda path, limit: None)
        return reference_limit(load_course("hangar-400"), KART_60)


@pytest.mark.parametrize("name", LINES)
def test_no_line_asks_for_more_grip_than_there_is(kart_limit: Limit, name: str) -> None:
    used = grip_used(getattr(kart_limit, name), bounds_of(KART_60))
    # Optimal laps keep to the grip at their stations; between them they take the mean of both.
    assert np.mean(used > 1.03) < 0.02
    assert used.max() < (1.1 if name in {"minimum_time", "with_room"} else 1.001)


def test_no_line_leaves_the_track_or_steers_too_far(kart_limit: Limit) -> None:
    course, bounds = load_course("hangar-400"), bounds_of(KART_60)
    for name in ("minimum_time", "minimum_curvature", "shortest"):
        line = getattr(kart_limit, name)
        clear, _ = nearest_on(course.borders, np.stack([line.x, line.y], axis=1))
        assert clear.min() > 0.9 * bounds.reach
        assert np.abs(line.curvature).max() < bounds.curvature + 1e-6


@pytest.mark.parametrize(
    ("track", "vehicle"),
    [("hangar-400", KART_60), ("covapsy-train-2023", TT02), ("oval-report", TT02_FACTS)],
)
def test_the_speeds_of_the_best_line_are_those_of_the_best_lap(
    track: str, vehicle: Vehicle
) -> None:
    bounds = bounds_of(vehicle)
    limit = read_bundled(load_course(track), bounds)
    assert limit is not None
    best = limit.minimum_time
    steps = np.append(np.diff(best.distance), best.length - best.distance[-1])
    speeds = speeds_on(steps, best.curvature, bounds)
    assert lap_time(steps, speeds) == pytest.approx(best.time_s, rel=0.004)


def test_points_curvatures_and_zones_of_a_line_fit_together(kart_limit: Limit) -> None:
    best = kart_limit.minimum_time
    turn = np.diff(np.unwrap(best.heading))
    steps = np.diff(best.distance)
    assert np.allclose(turn, 0.5 * steps * (best.curvature[1:] + best.curvature[:-1]), atol=0.01)
    assert np.allclose(np.hypot(np.diff(best.x), np.diff(best.y)), steps, atol=0.03)
    kinds = [zone.what for zone in best.zones]
    assert {"brake", "accelerate"} <= set(kinds)
    assert all(before != after for before, after in pairwise(kinds))
    assert all(zone.end == after.start for zone, after in pairwise(best.zones))


@pytest.mark.parametrize("track", ["oval", "covapsy-base", "colline-1100"])
def test_the_stations_go_round_once_and_lie_inside(track: str) -> None:
    frame = frame_of(load_course(track), bounds_of(TT02))
    assert abs(float(np.sum(frame.curvature)) * frame.step) == pytest.approx(2 * math.pi, abs=1e-6)
    assert (np.diff(frame.progress) > 0.0).all()
    assert (frame.low < frame.high).all()
    assert (centre_line(frame).stretch(frame) == 1.0).all()


def test_a_limit_is_solved_once(shelf: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("casadi")
    course = load_course("oval-report")
    first = reference_limit(course, TT02_FACTS)
    with monkeypatch.context() as patch:
        patch.setattr(reference, "solve", lambda course, bounds: pytest.fail("solved again"))
        again = reference_limit(course, TT02_FACTS)
    for name in LINES:
        kept, line = getattr(again, name), getattr(first, name)
        assert kept.time_s == line.time_s
        assert np.array_equal(kept.speed, line.speed)
        assert np.array_equal(kept.x, line.x)
    assert again.solve_s == first.solve_s
    reference_limit(course, TT02_FACTS, 3.0)
    assert len(list(shelf.glob("*.npz"))) == 2


@pytest.mark.parametrize("damage", [b"", b"no limit", b"PK\x03\x04 half a file"])
def test_a_damaged_file_is_solved_again(shelf: Path, damage: bytes) -> None:
    pytest.importorskip("casadi")
    course = load_course("oval-report")
    first = reference_limit(course, TT02_FACTS)
    (path,) = shelf.iterdir()
    path.write_bytes(damage)
    again = reference_limit(course, TT02_FACTS)
    assert again.minimum_time.time_s == pytest.approx(first.minimum_time.time_s)
    assert path.stat().st_size > 1000


def test_every_track_of_ours_comes_with_its_limits() -> None:
    wanted = {bundled_name(course, bounds_of(vehicle)) for course, vehicle in exports()}
    assert wanted == {path.name for path in limits_folder().glob("*.npz")}, "run `make limits`"
    assert sum(path.stat().st_size for path in limits_folder().iterdir()) < 400_000


@pytest.mark.parametrize(("track", "vehicle"), [("oval", TT02), ("hangar-400", KART_60)])
def test_a_shipped_limit_is_what_the_solver_finds(track: str, vehicle: Vehicle) -> None:
    course, bounds = load_course(track), bounds_of(vehicle)
    shipped = read_bundled(course, bounds)
    assert shipped is not None
    found = limit_of(course, bounds, solve(course, bounds), 0.0)
    for name in LINES:
        ours, fresh = getattr(shipped, name), getattr(found, name)
        assert ours.time_s == pytest.approx(fresh.time_s, rel=2e-4), "run `make limits`"
        assert np.allclose(ours.x, fresh.x, atol=0.01 * course.width_mean)
        assert np.allclose(ours.speed, fresh.speed, atol=0.05)


def test_another_cap_or_track_is_not_shipped() -> None:
    course = load_course("oval")
    assert read_bundled(course, bounds_of(TT02)) is not None
    assert read_bundled(course, bounds_of(TT02, 3.0)) is None
    assert read_bundled(replace(course, digest="another"), bounds_of(TT02)) is None


def test_a_shipped_limit_needs_no_casadi(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    monkeypatch.setitem(sys.modules, "casadi", None)
    assert reference_limit(load_course("oval"), TT02).minimum_time.time_s == pytest.approx(
        5.830, abs=1e-3
    )


def test_without_casadi_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(RaceError, match=r"pip install race-server\[mpc\]"):
        reference_limit(load_course("oval-report"), TT02_FACTS)


def test_a_course_that_no_line_fits_is_an_error(tmp_path: Path) -> None:
    pytest.importorskip("casadi")
    with pytest.raises(TrackError, match=r"1\.20 m wide at .* no line fits .* needs 1\.98 m"):
        reference_limit(load_course("oval-report"), KART_60)
    with pytest.raises(TrackError, match=r"ring: .* no line fits .* bends tighter"):
        reference_limit(ring(tmp_path, 0.6, 0.2), TT02_FACTS)


@pytest.mark.parametrize("cap", [0.0, -1.0, math.nan, math.inf])
def test_a_cap_that_is_no_speed_is_an_error(cap: float) -> None:
    with pytest.raises(VehicleError, match="give a speed above"):
        bounds_of(TT02, cap)


def test_a_margin_that_is_no_length_is_an_error() -> None:
    with pytest.raises(VehicleError, match=r"margin -0\.1 m"):
        bounds_of(TT02, None, -0.1)


def test_the_command_prints_and_draws(tmp_path: Path) -> None:
    pytest.importorskip("casadi")
    from race_server.cli.main import app

    words = ["limit", "oval-report", "--vehicle", "tt02-facts", "--speed-cap", "3.33"]
    picture = tmp_path / "limit.png"
    shown = CliRunner().invoke(app, [*words, "--json", "--plot", str(picture)])
    assert shown.exit_code == 0, shown.output
    row = json.loads(shown.stdout)
    assert (row["track"], row["vehicle"], row["speed_cap"]) == ("oval-report", "tt02-facts", 3.33)
    assert row["minimum_time_s"] == pytest.approx(6.25, rel=0.015)
    assert set(row) == {"track", "vehicle", "speed_cap", "solve_s", *(f"{n}_s" for n in LINES)}
    assert picture.read_bytes().startswith(b"\x89PNG")
    table = CliRunner().invoke(app, words)
    assert "minimum time" in table.stdout


def test_a_rough_search_of_the_oval_is_slower_than_an_exact_one_by_less_than_0_3_percent() -> None:
    course, bounds = load_course("oval-report"), bounds_of(TT02)
    exact = fastest_of(course, bounds).best.time_s
    rough = fastest_of(course, bounds, Search(tolerance=ROUGH)).best.time_s
    assert exact < rough < 1.003 * exact


def test_a_root_that_has_no_value_where_the_search_begins_is_no_warning(
    capfd: pytest.CaptureFixture[str],
) -> None:
    program = Program(3, 1.0)
    place = program.unknown(-5.0, 5.0, 0.0)
    cost = program.casadi.sum1((place - 3.0) ** 2 + program.casadi.sqrt(place - 1.0))
    with pytest.raises(TrackError, match="no line fits"):
        program.minimise(cost, "ring")
    assert capfd.readouterr().err == ""
