"""The life of a race session, without a network."""

import pytest

from race_server.core.messages import Button, Control, EventKind, Phase, Status
from race_server.errors import ScenarioError, SeatError, WireError
from race_server.live.server.publisher import snapshot_of
from race_server.scenario.track.load import load_course
from race_server.session.failsafe import (
    AWAY_TICKS,
    BRAKE_TICKS,
    COAST_TICKS,
    FRESH_TICKS,
    SLOW_TICKS,
    STOP,
    FailsafeStage,
    control_under,
    failsafe_stage,
)
from race_server.session.session import Session
from support.sessions import session_on_ring


def lobby(karts: int = 2, laps: int = 1) -> Session:
    return session_on_ring("test", karts, laps=laps, countdown_s=0.5)


def racing(karts: int = 2) -> Session:
    session = lobby(karts)
    for number in range(karts):
        session.join(f"driver {number}", "track")
        session.seats[number].is_ready = True
    session.start()
    session.advance(60)
    assert session.phase is Phase.RUNNING
    return session


def test_drivers_get_the_free_seats_in_order() -> None:
    session = lobby()
    assert [session.join("a", "lidar").number, session.join("b", "track").number] == [0, 1]


def test_a_full_lobby_says_so() -> None:
    session = lobby(karts=1)
    session.join("a", "lidar")
    with pytest.raises(SeatError, match="all 1 seats are taken"):
        session.join("b", "lidar")


def test_a_wanted_seat_that_is_taken_is_named_with_its_driver() -> None:
    session = lobby()
    session.join("a", "lidar", wanted=1)
    with pytest.raises(SeatError, match="seat 1 is taken by a"):
        session.join("b", "lidar", wanted=1)


def test_a_seat_that_does_not_exist_is_refused() -> None:
    with pytest.raises(SeatError, match="seat 7 does not exist; seats are 0 to 1"):
        lobby().join("a", "lidar", wanted=7)


def test_an_unknown_observation_is_refused() -> None:
    with pytest.raises(SeatError, match="'sonar' is unknown"):
        lobby().join("a", "sonar")


def test_the_race_starts_when_all_who_sit_there_are_ready() -> None:
    session = lobby()
    assert not session.can_start()
    session.join("a", "lidar")
    assert not session.can_start()
    session.seats[0].is_ready = True
    assert session.can_start()


def test_an_empty_seat_has_no_kart() -> None:
    session = lobby()
    session.join("a", "lidar")
    session.start()
    assert list(session.world.bodies["status"][0]) == [Status.RACING, Status.ABSENT]


def test_countdown_turns_into_the_race_and_the_race_into_results() -> None:
    session = lobby(karts=1)
    session.join("a", "track")
    session.start()
    assert session.phase is Phase.COUNTDOWN
    session.advance(31)
    assert session.phase is Phase.RUNNING
    session.leave(0)
    session.advance(1)
    assert session.phase is Phase.FINISHED


def test_nobody_joins_a_race_that_has_begun() -> None:
    session = racing()
    with pytest.raises(SeatError, match="the race has begun"):
        session.join("late", "track")


def test_a_driver_that_was_away_gets_its_seat_back_with_its_secret() -> None:
    session = lobby()
    for number in range(2):
        session.join(f"driver {number}", "track", secret=700 + number)
    session.start()
    session.drop(1)
    assert not session.seats[1].is_present
    assert session.join("driver 1", "track", wanted=1, secret=701).number == 1
    assert session.seats[1].is_present


def test_nobody_takes_a_seat_with_a_wrong_secret() -> None:
    session = racing()
    with pytest.raises(SeatError, match="the race has begun"):
        session.join("thief", "track", wanted=1, secret=12345)
    session = Session("race", session.scenario)
    session.join("owner", "track", wanted=1, secret=777)
    with pytest.raises(SeatError, match="seat 1 is taken by owner"):
        session.join("thief", "track", wanted=1, secret=12345)


def test_a_join_that_is_repeated_takes_one_seat_only() -> None:
    session = Session("race", racing().scenario)
    first = session.join("owner", "track", secret=777)
    assert session.join("owner", "track", secret=777) is first
    assert sum(seat.is_taken for seat in session.seats) == 1


def test_a_driver_that_stays_away_has_withdrawn() -> None:
    session = racing()
    session.drop(1)
    session.advance(AWAY_TICKS + 60)
    session.advance(1)
    assert session.world.bodies["status"][0, 1] == Status.RETIRED


def test_a_driver_that_is_gone_when_its_race_starts_again_has_withdrawn_in_time() -> None:
    session = racing()
    session.is_event = session.keeps_seats = True
    session.drop(1)
    session.reopen()
    session.start()
    events = []
    for tick in range(0, AWAY_TICKS + 3, 3):
        session.receive_control(0, session.epoch, tick + 1, session.tick, STOP)
        events += session.advance(3)
    assert [event.kart for event in events if event.kind is EventKind.RETIRED] == [1]
    assert session.is_racing(0)


def test_a_namesake_that_was_sent_away_or_has_a_real_kart_keeps_no_driver_from_its_seat() -> None:
    session = lobby(karts=3)
    session.join("Anna", "track", tracked=True)
    for _ in range(2):
        session.join("Anna", "track")
    session.is_event = session.keeps_seats = True
    session.race_control.exclude(1)
    with pytest.raises(SeatError, match="seat 1 is closed: the steward sent its driver away"):
        session.join("Anna", "track", secret=33)
    session.drop(0)
    session.drop(2)
    assert session.join("Anna", "track", secret=33).number == 2


def test_a_seat_whose_driver_was_sent_away_stays_so_however_often_it_is_closed() -> None:
    session = racing()
    session.race_control.exclude(1)
    session.race_control.close_seat(1)
    assert session.seats.is_sent_away(1)
    session.race_control.open_seat(1)
    session.race_control.close_seat(1)
    assert not session.seats.is_sent_away(1)


def test_the_kart_of_a_driver_that_drops_stops() -> None:
    session = racing()
    session.receive_control(0, 1, 1, session.tick, Control(throttle=1.0))
    session.advance(15)
    assert session.world.bodies["speed"][0, 0] > 0.2
    session.drop(0)
    session.advance(60)
    assert session.world.bodies["speed"][0, 0] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("ticks", "silence"),
    [
        (FRESH_TICKS, FailsafeStage.FRESH),
        (FRESH_TICKS + 1, FailsafeStage.COASTING),
        (COAST_TICKS + 1, FailsafeStage.BRAKING),
        (BRAKE_TICKS + 1, FailsafeStage.STOPPED),
    ],
)
def test_silence_grows_from_fresh_to_stopped(ticks: int, silence: FailsafeStage) -> None:
    assert failsafe_stage(ticks, is_linked=True) is silence


def test_a_kart_whose_link_has_gone_brakes_at_once() -> None:
    assert failsafe_stage(0, is_linked=False) is FailsafeStage.BRAKING


def test_a_kart_steers_on_until_it_is_to_stand() -> None:
    last = Control(steering=0.3, throttle=0.8, buttons=Button.USE_ITEM)
    assert control_under(FailsafeStage.FRESH, last) is last
    assert control_under(FailsafeStage.COASTING, last) == Control(steering=0.3)
    assert control_under(FailsafeStage.BRAKING, last) == Control(steering=0.3, brake=0.5)
    assert control_under(FailsafeStage.STOPPED, last) == STOP


def test_a_slow_kart_goes_on_longer_unheard_but_never_drives_off_again() -> None:
    session = racing()
    session.receive_control(0, 1, 1, session.tick, Control(throttle=0.5))
    throttles = []
    for _ in range(180):
        session.advance(1)
        throttles.append(float(session.world.bodies["throttle"][0, 0]))
    driven = throttles.count(0.5)
    assert FRESH_TICKS + 10 < driven < FRESH_TICKS + SLOW_TICKS + 10
    assert throttles == [0.5] * driven + [0.0] * (180 - driven)


def test_a_silent_driver_coasts_then_brakes_then_stands() -> None:
    session = racing()
    session.receive_control(0, 1, 1, session.tick, Control(throttle=1.0))
    brakes = []
    for _ in range(120):
        session.world.bodies["speed"][0, 0] = 3.0  # too fast for any grace
        session.advance(1)
        brakes.append(float(session.world.bodies["brake"][0, 0]))
    assert [brakes[tick] for tick in (10, 25, 40, 110)] == [0.0, 0.0, 0.5, 1.0]
    assert session.seats[0].silence is FailsafeStage.STOPPED


def test_a_driver_that_hangs_with_its_link_open_has_withdrawn() -> None:
    session = racing()
    session.receive_control(0, 1, 1, session.tick, Control(throttle=1.0))
    for _ in range(SLOW_TICKS + BRAKE_TICKS + AWAY_TICKS + 10):
        session.advance(1)
    assert session.world.bodies["status"][0, 0] == Status.RETIRED
    assert session.world.bodies["status"][0, 1] == Status.RACING  # it never drove: nothing hangs


def test_who_is_back_within_the_grace_keeps_place_laps_and_penalties() -> None:
    session = racing()
    session.world.racers["laps"][0, 1] = 2
    session.world.racers["penalties"][0, 1] = 1
    session.drop(1)
    for _ in range(AWAY_TICKS - 5):
        session.advance(1)
    before = session.world.racers[["laps", "penalties", "rank"]][0, 1].item()
    session.come_back(1)
    for _ in range(BRAKE_TICKS):
        session.advance(1)
    session.receive_control(1, 1, 1, session.tick, Control(throttle=1.0))
    session.advance(1)
    assert session.world.bodies["status"][0, 1] == Status.RACING
    assert session.world.racers[["laps", "penalties", "rank"]][0, 1].item() == before
    assert session.seats[1].silence is FailsafeStage.FRESH


def test_a_control_of_another_epoch_is_refused() -> None:
    session = racing()
    with pytest.raises(WireError, match="epoch 9, this is epoch 1"):
        session.receive_control(0, 9, 1, 0, Control())


def test_a_replayed_control_is_refused() -> None:
    session = racing()
    session.receive_control(0, 1, 5, 0, Control())
    with pytest.raises(WireError, match="control 5 again"):
        session.receive_control(0, 1, 5, 0, Control())


def test_a_control_cannot_answer_the_future() -> None:
    session = racing()
    with pytest.raises(WireError, match="answers tick 9999"):
        session.receive_control(0, 1, 1, 9999, Control())


def test_lockstep_waits_for_who_races_and_is_there() -> None:
    session = racing(karts=3)
    session.receive_control(0, 1, 1, session.tick, Control())
    session.drop(1)
    assert session.waits_for() == [2]


def test_a_second_race_begins_like_the_first() -> None:
    session = lobby()
    session.join("a", "track")
    session.start()
    first = session.digest()
    session.advance(90)
    session.reopen()
    session.start()
    assert session.epoch == 2
    assert session.digest() == first


def test_late_comers_find_the_recent_events() -> None:
    session = racing()
    assert EventKind.GREEN in [event.kind for event in session.event_log.recent]


def test_more_karts_than_places_on_the_grid_are_refused() -> None:
    with pytest.raises(ScenarioError, match="its start grid has 10 places"):
        lobby(karts=11)


def test_an_unknown_contact_policy_is_refused() -> None:
    with pytest.raises(ScenarioError, match="'explode' is unknown; choose one of bump"):
        session_on_ring("test", wall_contact="explode")


@pytest.mark.parametrize(("items", "ready"), [(True, [1] * 6), (False, [0] * 6)])
def test_spectators_see_no_item_box_ready_in_a_race_without_items(
    items: bool, ready: list[int]
) -> None:
    session = session_on_ring("test", course=load_course("oval"), items=items)
    session.join("me", "track")
    session.start()
    assert snapshot_of(session).boxes.tolist() == ready
