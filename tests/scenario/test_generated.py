"""Random courses: each seed gives one, the same one everywhere, and a kart can lap it."""

import pytest

from race_server.core.vehicle_presets import KART_60, TT02
from race_server.core.vehicles import Vehicle
from race_server.errors import TrackError
from race_server.scenario.track.blocks import HALF_THICKNESS, lay, pieces_of
from race_server.scenario.track.build import SCALES, TrackSpec, build, periodic_spline
from race_server.scenario.track.check import check_course
from race_server.scenario.track.generated import generated_file
from race_server.scenario.track.load import load_course, own_tracks, spec_of
from race_server.scenario.track.polyline import (
    derivatives,
    is_inside,
    lengths_of,
    nearest_on,
    resample,
    segments_of,
)

# How many of each kind; a course that no kart can turn on is drawn again, which takes its time.
COUNTS = {"block": 100, "spline": 50}


def plan_named(name: str) -> TrackSpec:
    return spec_of(name, name, generated_file(name))


def pieces(plan: TrackSpec) -> str:
    """Return the pieces of the outer border, begun at whichever comes first in the alphabet."""
    assert plan.outer is not None
    words = "".join(pieces_of(plan.outer))
    return min(words[n:] + words[:n] for n in range(len(words)))


@pytest.fixture(scope="module")
def plans() -> dict[str, list[TrackSpec]]:
    return {
        kind: [plan_named(f"generated:{kind}:{seed}") for seed in range(count)]
        for kind, count in COUNTS.items()
    }


@pytest.mark.slow
def test_a_hundred_block_courses_close_and_leave_room_for_a_kart(
    plans: dict[str, list[TrackSpec]],
) -> None:
    for plan in plans["block"]:
        assert plan.outer is not None
        assert plan.inner is not None
        outer, inner = lay(plan.outer, HALF_THICKNESS), lay(plan.inner, -HALF_THICKNESS)
        assert is_inside(inner, segments_of(outer)).all(), plan.name
        assert nearest_on(segments_of(outer), inner)[0].min() > 0.89, plan.name


def test_borders_that_were_moved_to_an_eight_are_drawn_again() -> None:
    plan = plan_named("generated:block:1000016")  # its first inner border made no turn
    assert plan.inner is not None
    words = "".join(pieces_of(plan.inner))
    assert abs(words.count("L") - words.count("R")) == 4


def test_fifty_spline_courses_bend_no_tighter_than_a_kart_turns(
    plans: dict[str, list[TrackSpec]],
) -> None:
    for plan in plans["spline"]:
        curve = periodic_spline(plan.points, SCALES["1/10"].spacing)[:, :2]
        line = resample(curve, round(lengths_of(curve).sum() / 0.1))
        _, curvature = derivatives(line)
        assert 1.0 / abs(curvature).max() > TT02.turning_radius, plan.name


@pytest.mark.parametrize(
    ("name", "vehicle"),
    [
        ("generated:block:17", TT02),
        ("generated:spline:4", TT02),
        ("generated:spline:4:kart", KART_60),
        ("generated:circuit:9", TT02),
        ("generated:circuit:9:kart", KART_60),
        # Their half-widths, drawn apart, once crossed in between.
        ("generated:circuit:3000024", TT02),
        ("generated:circuit:3000041:kart", KART_60),
    ],
)
def test_the_loaders_own_check_finds_nothing_wrong(name: str, vehicle: Vehicle) -> None:
    course = build(plan_named(name))
    found = check_course(course, vehicle)
    assert not [finding for finding in found if finding.level == "error"]
    assert len(course.grid) >= 8


def test_different_seeds_give_different_courses(plans: dict[str, list[TrackSpec]]) -> None:
    blocks = {(p.outer and p.outer.blocks, p.inner and p.inner.blocks) for p in plans["block"]}
    splines = {plan.points.tobytes() for plan in plans["spline"]}
    assert {"block": len(blocks), "spline": len(splines)} == COUNTS


def test_the_same_seed_gives_the_same_bytes() -> None:
    for name in ("generated:block:17", "generated:spline:4"):
        again = generated_file.__wrapped__(name)
        assert again == generated_file(name)
    # A figure that changes makes other courses of all seeds: policies name them as their own.
    assert plan_named("generated:block:17").digest == "53d6f75b49029c27"
    assert plan_named("generated:spline:4").digest == "93369bef6e177451"


def test_no_generated_course_is_one_that_is_shipped(plans: dict[str, list[TrackSpec]]) -> None:
    files = [(path.stem, path.name, path.read_bytes()) for path in own_tracks().glob("*.toml")]
    shipped = {pieces(plan) for plan in (spec_of(*file) for file in files) if plan.outer}
    assert len(shipped) >= 3
    assert not shipped & {pieces(plan) for plan in plans["block"]}


@pytest.mark.parametrize(
    "name", ["generated:", "generated:maze:1", "generated:block:-1", "generated:block:1:kart"]
)
def test_a_name_that_generates_nothing_says_what_does(name: str) -> None:
    with pytest.raises(TrackError, match="write generated:block:SEED"):
        load_course(name)


def test_a_generated_course_has_the_name_it_was_asked_by() -> None:
    assert load_course("generated:spline:4").name == "generated:spline:4"


def test_circuits_have_straights_that_end_in_braking_and_any_length_and_width() -> None:
    plans = [plan_named(f"generated:circuit:{seed}") for seed in range(40)]
    perimeters = [lengths_of(plan.points[:, :2]).sum() for plan in plans]
    half_widths = [plan.points[:, 2].mean() for plan in plans]
    assert min(perimeters) < 60.0
    assert max(perimeters) > 300.0
    assert min(half_widths) < 0.6
    assert max(half_widths) > 1.2
    # On 10 m a 1/10 car comes from 3 m/s to 7 m/s; the preview of its line is 3.4 m long.
    longest = [lengths_of(plan.points[:, :2]).max() for plan in plans]
    assert sum(straight > 10.0 for straight in longest) > 20


def test_a_circuit_bends_no_tighter_than_a_kart_turns() -> None:
    for seed in range(8):
        plan = plan_named(f"generated:circuit:{seed}")
        curve = periodic_spline(plan.points, SCALES["1/10"].spacing)[:, :2]
        line = resample(curve, round(lengths_of(curve).sum() / 0.1))
        _, curvature = derivatives(line)
        assert 1.0 / abs(curvature).max() > 0.95 * TT02.turning_radius, plan.name
