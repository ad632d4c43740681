"""Points of meetings, by the public calculator of Euro NCAP."""

import pytest

from race_agents.plant.encounter import KMH
from race_agents.plant.matrices import _least_impact, karts, people
from race_agents.plant.points import MATRICES, points_of
from race_server.core.vehicle_presets import KART_60

pytest.importorskip("euroncap_rating_2026")


def cells(name: str) -> dict[tuple[int, int], float]:
    """Return the cells that we drive of a matrix, all avoided."""
    cases = [case for of in (people, karts) for case in of(KART_60) if case.name == name]
    return {(round(case.speed / KMH), round(100.0 * case.share)): 0.0 for case in cases}


@pytest.mark.slow
@pytest.mark.parametrize("name", MATRICES)
def test_who_avoids_everything_gets_all_points_that_there_are(name: str) -> None:
    points = points_of(name, cells(name))
    assert points.cells > 0
    assert (points.standard, points.extended) == pytest.approx(
        (points.most_standard, points.most_extended)
    )


@pytest.mark.parametrize("name", MATRICES)
def test_who_brakes_for_nothing_gets_none_above_20_km_h(name: str) -> None:
    driven = {cell: float(cell[0]) for cell in cells(name)}
    assert points_of(name, driven).total == 0.0


def test_a_hit_at_12_km_h_counts_by_the_speed_that_was_driven() -> None:
    # Six cells of CPFA in the middle are the standard range: half a point in all. At 60 km/h a hit
    # of 12 km/h is worth half of a cell, at 40 km/h a quarter, at 30 km/h nothing.
    middle = {cell: 0.0 for cell in cells("CPFA") if cell[1] == 50}
    for speed, lost in ((60, 0.5), (40, 0.75), (30, 1.0)):
        points = points_of("CPFA", {**middle, (speed, 50): 12.0})
        assert points.standard == pytest.approx(0.5 * (6.0 - lost) / 6.0), speed


def test_cells_that_are_not_of_the_protocol_do_not_count() -> None:
    # A kart that brakes is met from 30 km/h on, there.
    assert points_of("CCRb", {(10, 50): 0.0, (20, 50): 0.0, (30, 50): 0.0}).cells == 1


def test_no_brake_avoids_a_child_at_60_km_h_and_every_brake_one_at_20() -> None:
    children = {
        (round(case.speed / KMH), case.share): _least_impact(case, KART_60)
        for case in people(KART_60)
        if case.name == "CPNCO"
    }
    # Seen 1.19 s before the middle would be hit: 18.1 m to stop in; 60 km/h takes 21.4.
    assert children[60, 0.5] / KMH == pytest.approx(23.3, abs=0.1)
    assert children[20, 0.5] == 0.0
