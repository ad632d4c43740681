"""What the server sends: observations to seats, the state of the race to spectators."""

import time
from collections.abc import Callable, Container, Iterable, Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from race_server.core import codes
from race_server.core.clock import MICROSECONDS, TICKS_PER_SECOND
from race_server.core.messages import Event, Flag, KartFlag, PoseFault, Trust
from race_server.core.state import EFFECTS, Floats, World, field_of
from race_server.live.server.hud import hud_of, huds_of, lights_s
from race_server.live.server.lot import lot_of, order_frame_of, walkers_of
from race_server.live.server.trailers import trailers_of
from race_server.net.transport import ServerLink
from race_server.net.wire import topics
from race_server.net.wire.alert import AlertsFrame, encode_alerts
from race_server.net.wire.drive import HudWriter, ObservationWriter
from race_server.net.wire.links import LINK, LinksFrame, encode_links
from race_server.net.wire.parking import encode_lot, encode_order
from race_server.net.wire.spectate import (
    HAZARD,
    KART,
    SnapshotFrame,
    SnapshotWriter,
    StandingsFrame,
    encode_events,
    encode_standings,
)
from race_server.net.wire.telemetry import TelemetriesFrame, encode_telemetries
from race_server.net.wire.topics import Topic
from race_server.session.parking import goes_to_slot, has_lot
from race_server.session.seats import Seat
from race_server.session.session import Session

# Between two messages of an event [s], and after how many of them the ghosts are sent again.
EVENT_S, GHOSTS_EVERY = 0.5, 4


class Sink(Protocol):
    """Takes what spectators are sent: a link sends it, a recording keeps it."""

    def publish(self, topic: Topic, payload: bytes) -> None:
        """Take a message of a topic."""


class Board(Protocol):
    """An event of several races as messages; empty where there is nothing to send."""

    @property
    def programme(self) -> bytes:
        """What is on, what comes, and the classification."""

    @property
    def ghosts(self) -> bytes:
        """What is driven against now."""


class Publisher:
    """Puts the race into messages and sends them."""

    def __init__(
        self,
        session: Session,
        link: ServerLink,
        recording: Sink,
        *,
        orders_s: float,
        ways: Callable[[], Mapping[int, Floats]] = dict,
    ) -> None:
        """Prepare the writers.

        orders_s: a real kart that receives no newer orders for this long stops by itself; ways:
        returns what drivers of the server have planned, by seat, (N, 2) [m].
        """
        self._session = session
        self._link = link
        self._sinks: tuple[Sink, ...] = (link, recording)
        self._orders_s, self._ways = orders_s, ways
        self._order_stop_us = 0  # due again
        self._snapshots = SnapshotWriter()
        self._observations: dict[int, ObservationWriter] = {}
        self._huds = HudWriter()
        self.board: Board | None = None  # of the event that the race is part of
        self._event_at, self._turn = 0.0, 0  # when the event was sent, and how often

    def publish_seats(self, *, but: Container[int]) -> None:
        """Send every seat whose driver is there its observation, and what acts on its kart."""
        seats = [
            seat for seat in self._session.lined_up() if seat.is_present and seat.number not in but
        ]
        frames = huds_of(self._session, seats, self._orders_s)
        for seat, frame in zip(seats, frames, strict=True):
            self._publish_observation(seat)
            self._link.publish(topics.HUD, self._huds.write(frame), seat.number)

    def repeat(self, seats: Iterable[Seat], *, but: Container[int]) -> None:
        """Send seats whose driver is there their observation again."""
        for seat in seats:
            if seat.is_present and seat.number not in but:
                self._publish_observation(seat)

    def repeat_orders(self) -> None:
        """Send real karts again the orders that they have not acknowledged yet."""
        for number, tracker in self._session.tracked_karts.trackers.items():
            seat = self._session.seats[number]
            if tracker.orders.is_open and seat.is_present:
                self._publish_hud(seat)

    def order_stop(self, now_us: int) -> None:
        """Tell the real karts to stand while the race is paused, ten times as often as they need.

        now_us: the time of the clock by which they are followed.
        """
        if now_us < self._order_stop_us:
            return
        self._publish_alerts()
        self._order_stop_us = now_us + round(0.1 * self._orders_s * MICROSECONDS)
        tracked = self._session.tracked_karts
        tracked.give_orders(self._session.world, now_us, is_paused=True)
        for number in tracked.trackers:
            if (seat := self._session.seats[number]).is_present:
                self._publish_hud(seat)

    def _publish_hud(self, seat: Seat) -> None:
        """Send a seat what acts on its kart."""
        frame = hud_of(self._session, seat, self._orders_s)
        self._link.publish(topics.HUD, self._huds.write(frame), seat.number)

    def _publish_observation(self, seat: Seat) -> None:
        """Send a seat its observation."""
        session = self._session
        values = session.view(seat.number)
        writer = self._observations.get(len(values))
        if writer is None:
            writer = self._observations[len(values)] = ObservationWriter(len(values))
        data = writer.write(session.epoch, session.tick, seat.sequence, seat.number, values)
        self._link.publish(topics.OBSERVATION, data, seat.number)

    def publish_snapshot(self) -> None:
        """Send the race as spectators see it now, and what is new of real karts."""
        self._publish(topics.SNAPSHOT, self._snapshots.write(snapshot_of(self._session)))
        self._publish_alerts()

    def _publish_alerts(self, *, again: bool = False) -> None:
        """Send what real karts see and do where that has changed, or again; and how they are."""
        tracked, now_us = self._session.tracked_karts, time.monotonic_ns() // 1000
        if tracked.alerts.has_news(now_us) or (again and tracked.trackers):
            frame = AlertsFrame(self._session.epoch, self._session.tick, tracked.alerts.by_seat)
            self._publish(topics.ALERTS, encode_alerts(frame))
        if tracked.telemetry.has_news(now_us):
            karts = tracked.telemetry.by_seat
            told = TelemetriesFrame(self._session.epoch, self._session.tick, karts)
            self._publish(topics.TELEMETRIES, encode_telemetries(told))

    def publish_standings(self) -> None:
        """Send the standings, and while a race is on the state of its drivers' links.

        What real karts see is sent again with them.
        """
        self._publish(topics.STANDINGS, encode_standings(standings_of(self._session)))
        if has_lot(self._session.world):
            self._publish(topics.LOT, encode_lot(lot_of(self._session, self._ways())))
            self.publish_orders()
        self._publish_alerts(again=True)
        if self._session.is_on:
            self._publish(topics.LINKS, encode_links(links_of(self._session)))

    def publish_event(self) -> None:
        """Send the event as it stands, twice a second however often this is called."""
        now = time.monotonic()
        if self.board is None or now < self._event_at:
            return
        self._event_at, self._turn = now + EVENT_S, self._turn + 1
        if programme := self.board.programme:
            self._publish(topics.PROGRAMME, programme)
        if self._turn % GHOSTS_EVERY == 0 and (ghosts := self.board.ghosts):
            self._publish(topics.GHOSTS, ghosts)

    def begin(self) -> None:
        """Send what all must know of a race that has just begun."""
        self._event_at, self._turn = 0.0, -1
        self.publish_event()
        self.publish_standings()

    def record_standings(self) -> None:
        """Record how all ended, before the recording does."""
        *_, recording = self._sinks
        recording.publish(topics.STANDINGS, encode_standings(standings_of(self._session)))
        if self.board is not None:
            recording.publish(topics.PROGRAMME, self.board.programme)

    def publish_end(self) -> None:
        """Send the end of a race, whose result is written."""
        self.publish_snapshot()
        self.publish_standings()

    def publish_orders(self) -> None:
        """Send every seat the order to park that it was given in this race."""
        for seat in self._session.seats.taken():
            if seat.orders and seat.is_present and goes_to_slot(self._session.world, seat.number):
                data = encode_order(order_frame_of(self._session, seat))
                self._link.publish(topics.ORDER, data, seat.number)

    def publish_events(self, events: list[Event]) -> None:
        """Send what happened."""
        self._publish(topics.EVENTS, encode_events(self._session.epoch, events))

    def _publish(self, topic: Topic, payload: bytes) -> None:
        for sink in self._sinks:
            sink.publish(topic, payload)


def _ready_boxes(world: World, tick: int) -> NDArray[np.uint8]:
    """Return 1 for each item box that is ready; none is where the rules have no items."""
    ready = world.boxes["ready_tick"][0] <= tick
    return (ready & bool(world.rules["items"][0])).astype(np.uint8)


def snapshot_of(session: Session) -> SnapshotFrame:
    """Return the race as spectators see it now."""
    world, tick = session.world, session.tick
    race = world.races[0]
    bodies, racers, players = world.bodies[0], world.racers[0], world.players[0]
    karts = np.zeros(len(bodies), KART)
    for name in _SAME_NAMES:
        karts[name] = field_of(world, name)[0]
    karts["item"] = players["held"]
    karts["seat"] = np.arange(len(bodies))
    karts["acknowledged"] = [seat.sequence for seat in session.seats]
    karts["effects"] = (players["effects"]["source"] > 0).sum(axis=1) if EFFECTS else 0
    safe = np.maximum(players["immune_until"], players["shield_until"]) > tick
    trust = bodies["trust"]
    bits = {
        KartFlag.WRONG_WAY: racers["wrong_way"],
        KartFlag.OFF_TRACK: racers["off_track"],
        KartFlag.RESCUE_OFFERED: racers["rescue_offered"],
        KartFlag.IMMUNE: safe,
        KartFlag.REAL: trust != codes.SIMULATED,
        KartFlag.DOUBTFUL: trust == codes.DOUBTFUL,
        KartFlag.SUSPENDED: trust >= codes.SUSPENDED,
        KartFlag.YELLOW: racers["yellow"],
    }
    karts["flags"] = sum(holds.astype(np.uint8) * bit.value for bit, holds in bits.items())
    placed = world.hazards[0][world.hazards["until_tick"][0] > tick]
    hazards = np.zeros(len(placed), HAZARD)
    for name in ("x", "y", "radius", "owner"):
        hazards[name] = placed[name]
    hazards["item"] = placed["source"]
    return SnapshotFrame(
        monotonic_us=time.monotonic_ns() // 1000,
        epoch=session.epoch,
        tick=tick,
        lights_s=lights_s(session),
        phase=session.phase,
        flag=Flag(int(race.flag)),
        karts=karts[bodies["status"] != codes.ABSENT],
        boxes=_ready_boxes(world, tick),
        hazards=hazards,
        walkers=walkers_of(session),
        trailers=trailers_of(session),
    )


def standings_of(session: Session) -> StandingsFrame:
    """Return the standings as they are now."""
    race = session.world.races[0]
    return StandingsFrame(
        epoch=session.epoch,
        tick=session.tick,
        start_tick=int(race.start_tick),
        phase=session.phase,
        flag=Flag(int(race.flag)),
        laps=session.scenario.rules.laps,
        course=session.scenario.course.name,
        rows=tuple(session.standings()),
    )


def links_of(session: Session) -> LinksFrame:
    """Return the state of each driver's link now."""
    taken, tick, trackers = session.lined_up(), session.tick, session.tracked_karts.trackers
    statuses = session.world.bodies["status"][0]
    rows = np.zeros(len(taken), LINK)
    for row, seat in zip(rows, taken, strict=True):
        is_heard = seat.control_tick >= 0 and statuses[seat.number] == codes.RACING
        tracker = trackers.get(seat.number)
        row["seat"], row["silence"] = seat.number, seat.silence
        row["age"] = (tick - seat.control_tick) * 1000 // TICKS_PER_SECOND if is_heard else -1
        row["trust"] = tracker.trust if tracker else Trust.SIMULATED
        row["fault"] = tracker.doubt if tracker else PoseFault.NONE
    return LinksFrame(session.epoch, tick, rows)


_SAME_NAMES = (
    "x",
    "y",
    "heading",
    "speed",
    "lateral_speed",
    "yaw_rate",
    "steering",
    "progress",
    "speed_cap",
    "laps",
    "rank",
    "status",
)
