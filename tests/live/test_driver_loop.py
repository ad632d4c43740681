"""What a driver answers to each observation, without a network."""

from dataclasses import replace

import numpy as np
import pytest

from race_server.core.clock import TICK_S
from race_server.core.driver import Briefing
from race_server.core.level import Level
from race_server.core.messages import Control, Event, EventKind
from race_server.core.observation import Observation, layout_of
from race_server.core.parking_order import ParkingOrder, Slot
from race_server.errors import DriverError, LinkError, SeatError
from race_server.live.client.driver import KartClient
from race_server.live.client.driver_loop import Answer, DriverLoop
from race_server.live.client.event_stream import EventStream
from race_server.live.client.latency_limiter import FRESH_S
from race_server.live.client.link_stats import LinkStats
from race_server.net.wire.drive import ObservationFrame
from race_server.net.wire.parking import OrderFrame
from support.briefings import briefing

LAYOUT = layout_of("track", 0)
DECISION_TICKS = 3


BRIEFING = briefing("track", decision_s=DECISION_TICKS * TICK_S)


class Driver:
    """Drives faster with each observation, and remembers what it was shown."""

    preset = "track"

    def __init__(self) -> None:
        self.shown: list[Observation] = []

    def reset(self, briefing: Briefing) -> None:
        pass

    def act(self, observation: Observation) -> Control:
        self.shown.append(observation)
        return Control(throttle=0.1 * len(self.shown))


class Client:
    """A loop with its driver, fed with observations that take `delay_s` to arrive."""

    def __init__(self, *, raw: bool = False) -> None:
        self.driver, self.stats = Driver(), LinkStats()
        self.loop = DriverLoop(
            self.driver, "driver", BRIEFING, LAYOUT, self.stats, give_up_s=30.0, now_s=0.0, raw=raw
        )

    def observe(
        self, tick: int, *, epoch: int = 1, delay_s: float = 0.0, finished: bool = False
    ) -> Answer | None:
        values = np.zeros(LAYOUT.size, np.float32)
        values[LAYOUT.slices["finished"]] = finished
        values[LAYOUT.slices["speed"]] = 2.0
        values[LAYOUT.slices["speed_cap"]] = 10.0
        frame = ObservationFrame(epoch, tick, acknowledged=0, seat=0, values=values)
        now_s = tick * TICK_S + delay_s
        answer = self.loop.on_frame(frame, now_s)
        if answer is not None:
            self.loop.on_sent(answer, now_s)
        return answer


def test_each_observation_is_answered_once_and_answers_are_numbered() -> None:
    client = Client()
    answers = [client.observe(tick) for tick in (0, 3, 6)]
    assert [answer and (answer.epoch, answer.sequence, answer.tick) for answer in answers] == [
        (1, 1, 0),
        (1, 2, 3),
        (1, 3, 6),
    ]
    assert [seen.tick for seen in client.driver.shown] == [0, 3, 6]


def test_an_observation_that_arrives_again_gets_the_same_control_again() -> None:
    client = Client()
    first, again = client.observe(3), client.observe(3)
    assert first is not None
    assert again == replace(first, sequence=2)  # the server takes a number only once
    assert len(client.driver.shown) == 1


def test_an_observation_of_a_link_that_was_given_up_is_too_late() -> None:
    client = Client()
    client.observe(6)
    assert client.observe(3) is None
    assert client.stats.received == 1


def test_another_race_begins_with_the_sequence_that_the_server_has_taken() -> None:
    client = Client()
    client.observe(600)
    answer = client.observe(0, epoch=2)
    assert answer is not None
    assert (answer.epoch, answer.sequence, answer.tick) == (2, 1, 0)


def test_the_answer_to_the_last_observation_is_marked() -> None:
    client = Client()
    answers = [client.observe(0), client.observe(3, finished=True)]
    assert [answer and answer.is_last for answer in answers] == [False, True]


def test_a_silent_server_is_waited_for_and_then_given_up() -> None:
    client = Client()
    assert not client.loop.has_begun
    client.observe(60)
    assert client.loop.has_begun
    client.loop.on_silence(30.9)
    with pytest.raises(LinkError, match="no observation for 30 s"):
        client.loop.on_silence(31.1)


def drive_late(client: Client, delay_s: float) -> Answer:
    """Let the first observations arrive at once, and all others late; return the last answer."""
    client.observe(0)
    for tick in range(DECISION_TICKS, 1200, DECISION_TICKS):
        answer = client.observe(tick, delay_s=delay_s)
    assert answer is not None
    return answer


def test_over_a_slow_network_a_driver_is_shown_what_will_be_and_held_back() -> None:
    client = Client()
    answer = drive_late(client, 3.0 * FRESH_S)
    assert client.driver.shown[0].scalar("speed") == 2.0
    assert client.driver.shown[-1].scalar("speed") != 2.0
    assert answer.control.throttle < 0.5
    assert answer.control.brake > 0.0  # 2 m/s is too fast for what is 0.6 s old


def test_a_raw_driver_is_shown_what_was_and_sends_what_it_likes() -> None:
    client = Client(raw=True)
    answer = drive_late(client, 3.0 * FRESH_S)
    assert {seen.scalar("speed") for seen in client.driver.shown} == {2.0}
    assert answer.control == Control(throttle=0.1 * len(client.driver.shown))


def test_a_driver_that_raises_is_named() -> None:
    client = Client()
    client.driver.shown = None  # type: ignore[assignment]
    with pytest.raises(DriverError, match="driver 'driver' failed in act: AttributeError"):
        client.observe(0)


def test_a_client_is_a_function_or_a_class() -> None:
    observation = Observation(0, LAYOUT, np.zeros(LAYOUT.size, np.float32))
    client = KartClient(lambda seen: Control(throttle=0.1 + seen.tick), preset="track")
    client.reset(BRIEFING)
    assert (client.preset, client.briefing) == ("track", BRIEFING)
    assert client.act(observation) == Control(throttle=0.1)
    with pytest.raises(DriverError, match="give a function, or override `act`"):
        KartClient().act(observation)


# Events


def event(number: int) -> Event:
    return Event(number, number, EventKind.LAP, 0, 1, 1)


def numbers(events: list[Event]) -> list[int]:
    return [one.sequence for one in events]


def test_events_are_given_once_and_remembered_in_order_however_they_arrive() -> None:
    stream = EventStream(100)
    assert numbers(stream.receive(1, map(event, (5, 6)))) == [5, 6]
    assert numbers(stream.receive(1, map(event, (4, 3, 5, 6, 7)))) == [3, 4, 7]
    assert numbers(stream.receive(1, map(event, (3, 7)))) == []
    assert numbers(stream.recent()) == [3, 4, 5, 6, 7]


def test_forgotten_events_are_still_known() -> None:
    stream = EventStream(2)
    assert numbers(stream.receive(1, map(event, (1, 2, 3, 4)))) == [1, 2, 3, 4]
    assert numbers(stream.recent()) == [3, 4]
    assert numbers(stream.receive(1, map(event, (2, 4, 5)))) == [5]
    assert numbers(stream.recent()) == [4, 5]


def test_another_race_counts_its_events_from_one_again() -> None:
    stream = EventStream(100)
    stream.receive(1, map(event, (1, 2)))
    assert numbers(stream.receive(2, [event(1)])) == [1]
    assert numbers(stream.recent()) == [1]


class Parker(Driver):
    """Remembers its orders to park as well."""

    def __init__(self) -> None:
        super().__init__()
        self.slots: list[int] = []

    def park(self, order: ParkingOrder) -> None:
        self.slots.append(round(order.slot.x))


def order(epoch: int, sequence: int, x: float) -> OrderFrame:
    slot = Slot(x, 0.0, 0.0, 3.0, 2.0)
    return OrderFrame(
        epoch, sequence, ParkingOrder(slot, Level(), np.zeros((0, 4)), np.zeros((0, 5)))
    )


def test_a_driver_is_handed_each_order_to_park_once_and_the_first_one_again_in_a_new_race() -> None:
    client, parker = Client(), Parker()
    loop = DriverLoop(parker, "parker", BRIEFING, LAYOUT, client.stats, give_up_s=30.0, now_s=0.0)
    client.loop = loop
    loop.on_order(order(0, 0, 1.0))  # in the lobby
    client.observe(0, epoch=1)
    for sequence in (1, 1, 1):  # sent twice a second
        loop.on_order(order(1, sequence, 2.0))
    loop.on_order(None)
    client.observe(3, epoch=1)
    assert parker.slots == [1, 2]
    client.observe(0, epoch=2)
    loop.on_order(order(1, 1, 2.0))  # of the race before
    assert parker.slots == [1, 2, 1]


def test_a_driver_that_takes_no_orders_drives_on() -> None:
    client = Client()
    client.loop.on_order(order(1, 0, 1.0))
    assert client.observe(0) is not None


@pytest.mark.parametrize(
    ("name", "fault"),
    [("x" * 33, "33 characters"), (" Anna", "a space"), ("\x1b[1mAnna", "printed")],
)
def test_a_name_that_no_sheet_could_show_is_refused_before_the_server_is_asked(
    name: str, fault: str
) -> None:
    with pytest.raises(SeatError, match=fault):
        KartClient(lambda _: Control(), preset="track").run(name=name)
