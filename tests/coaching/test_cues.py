"""When a cue is spoken, and when help withdraws."""

from dataclasses import replace

import numpy as np
import pytest

from race_server.coaching.corners import Corner
from race_server.coaching.cues import (
    LATEST_S,
    SOONEST_S,
    SPOKEN_S,
    Cue,
    Moment,
    cues_for,
    due,
    time_to,
)
from race_server.coaching.fading import Attention, Fading, Help, after_lap
from race_server.coaching.faults import Fault, FaultKind
from race_server.coaching.lap import Lap

# A lap of 200 m at 10 m/s.
AT = np.linspace(0.0, 200.0, 201)
STILL = np.zeros(201)
BEST = Lap("best", 20_000_000, AT, AT / 10.0, AT, STILL, STILL, STILL + 10.0, STILL, STILL, STILL)
T1 = Corner("T1", begin=40.0, brake=60.0, entry=70.0, apex=80.0, exit=90.0, end=120.0, side=1)
T2 = replace(T1, name="T2", brake=5.0, entry=15.0, apex=20.0)
BRAKES = Cue("T1", FaultKind.EARLY_BRAKES, 60.0, "brake later")
FREE = Moment(0.0, 10.0, np.inf, np.inf, is_cautioned=False, is_driving=True, since_cue_s=np.inf)


def fault(corner: Corner, kind: FaultKind, cost_us: int = 100_000) -> Fault:
    return Fault(corner, kind, 6.0, "m", cost_us)


def spoken(moment: Moment = FREE, said: tuple[str, ...] = ()) -> list[float]:
    """Return where [m] a cue for brakes at 60 m is spoken, asked twenty times a second."""
    places = np.arange(0.0, 200.0, 0.5)
    return [
        float(place)
        for place in places
        if due([BRAKES], replace(moment, progress=place), BEST, said) is BRAKES
    ]


def test_a_cue_ends_between_1_and_1_4_seconds_before_the_place() -> None:
    # 10 m/s, and 0.8 s of speech: it begins 22 m to 18 m before, at 38 m to 42 m.
    assert spoken()[0] == pytest.approx(38.0, abs=0.5)
    assert spoken()[-1] == pytest.approx(42.0, abs=0.5)
    ends = [(60.0 - place) / 10.0 - SPOKEN_S for place in spoken()]
    assert LATEST_S - 1e-9 <= min(ends) <= max(ends) <= SOONEST_S


@pytest.mark.parametrize(
    "changed",
    [
        {"ahead_s": 0.9},
        {"behind_s": 0.5},
        {"is_cautioned": True},
        {"is_driving": False},
    ],
)
def test_in_traffic_under_a_flag_or_off_the_race_there_is_silence(
    changed: dict[str, float | bool],
) -> None:
    assert spoken(replace(FREE, **changed)) == []  # type: ignore[arg-type]


def test_a_corner_has_one_cue_in_a_lap() -> None:
    assert spoken(said=("T1",)) == []
    assert spoken(said=("T2",)) != []


def begins(*places: float) -> dict[str, float]:
    """Return when [s] in a lap the cues for some places [m] begin, by their corners."""
    cues = [replace(BRAKES, corner=f"T{n}", place=place) for n, place in enumerate(places, 1)]
    found: dict[str, float] = {}
    for now in np.arange(0.0, 20.0, 0.05).tolist():
        since = now - max(found.values(), default=-np.inf)
        moment = replace(FREE, progress=10.0 * now, since_cue_s=since)
        if cue := due(cues, moment, BEST, found):
            found[cue.corner] = now
    return found


def test_two_cues_are_never_spoken_at_once() -> None:
    # At 10 m/s a cue for 60 m is spoken from 3.8 s to 4.6 s. One for 63 m would begin from 4.1 s
    # to 4.5 s, one for 66 m from 4.4 s to 4.8 s, one for 70 m from 4.8 s on.
    assert begins(60.0, 63.0) == pytest.approx({"T1": 3.8}, abs=0.06)
    assert begins(60.0, 66.0) == pytest.approx({"T1": 3.8, "T2": 4.6}, abs=0.06)
    assert begins(60.0, 70.0) == pytest.approx({"T1": 3.8, "T2": 4.8}, abs=0.06)


def test_a_cue_that_was_missed_is_not_made_up_for() -> None:
    assert due([BRAKES], replace(FREE, progress=45.0), BEST, ()) is None


def test_a_place_behind_the_line_is_seen_from_before_it() -> None:
    assert time_to(BEST, replace(FREE, progress=190.0), 5.0) == pytest.approx(1.5)
    assert time_to(BEST, replace(FREE, progress=190.0), -5.0) == pytest.approx(0.5)


def test_a_kart_much_slower_than_on_its_best_lap_is_told_by_its_speed() -> None:
    slow = replace(FREE, progress=40.0, speed=5.0)
    assert time_to(BEST, slow, 60.0) == pytest.approx(4.0)
    assert time_to(BEST, replace(slow, speed=9.0), 60.0) == pytest.approx(2.0)


def test_cues_are_for_what_can_be_acted_on_one_for_each_corner() -> None:
    faults = [
        fault(T1, FaultKind.LIFT, 50_000),
        fault(T1, FaultKind.EARLY_BRAKES, 200_000),
        fault(T2, FaultKind.UNKNOWN),
    ]
    (cue,) = cues_for(faults)
    # He brakes 6 m before the 60 m of the limit, and must be told before that.
    assert (cue.corner, cue.words, cue.place) == ("T1", "brake later", 54.0)
    assert [cue.place for cue in cues_for([fault(T2, FaultKind.LATE_THROTTLE)])] == [20.0]


def test_where_the_limit_does_not_brake_the_cue_is_to_lift() -> None:
    (cue,) = cues_for([fault(replace(T1, is_braked=False), FaultKind.EARLY_BRAKES)])
    assert (cue.words, cue.place) == ("lift later", 54.0)


def course_of(laps: str) -> list[Help]:
    """Return the help after each lap: `i` inside the band, `o` outside."""
    now, found = Attention(), []
    for lap in laps:
        now = after_lap(now, is_inside=lap == "i")
        found.append(now.help)
    return found


def test_help_begins_with_the_first_fault_and_not_before() -> None:
    assert course_of("iio") == [Help.NONE, Help.NONE, Help.GIVEN]


def test_help_withdraws_after_three_laps_inside_in_a_row() -> None:
    assert course_of("oiii")[-2:] == [Help.GIVEN, Help.WITHDRAWN]
    assert course_of("oiioii")[-1] is Help.GIVEN


def test_each_corner_of_a_driver_has_its_own_help() -> None:
    fading = Fading(withdrawn_after=1)
    helped = []
    for faulty in ({"T1"}, {"T2"}, set(), {"T1", "T2"}, {"T1"}):
        fading.take(("T1", "T2"), faulty)
        helped.append({corner for corner in ("T1", "T2", "T3") if fading.helps(corner)})
    assert helped == [{"T1"}, {"T2"}, set(), set(), {"T1"}]


def test_withdrawn_help_returns_after_two_laps_outside_in_a_row() -> None:
    assert course_of("oiiioioio")[-1] is Help.WITHDRAWN
    assert course_of("oiiioo")[-1] is Help.GIVEN
