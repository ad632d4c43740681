"""The race server: hears the seats, lets time pass, tells everybody. Read `run` first."""

import gc
import time
from collections import Counter
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from race_server import codes
from race_server.clock import TICKS_PER_SECOND, Pacer, ticks_of
from race_server.driver import driver_named
from race_server.errors import DriverError, SeatError, WireError
from race_server.messages import Event, Flag, Phase, Standing
from race_server.paddock import Paddock, briefing_for
from race_server.results.keeper import Keeper
from race_server.results.writer import Writer
from race_server.rules.items import items
from race_server.session import Seat, Session
from race_server.state import EFFECTS
from race_server.transport import Request, ServerLink
from race_server.wire import topics
from race_server.wire.drive import (
    EFFECT,
    HudFrame,
    ObservationWriter,
    decode_control,
    encode_hud,
)
from race_server.wire.lobby import (
    CourseSheet,
    Welcome,
    decode_join,
    decode_seat_act,
    encode_course,
    encode_reply,
    encode_rules,
    encode_welcome,
)
from race_server.wire.spectate import (
    HAZARD,
    KART,
    SnapshotFrame,
    SnapshotWriter,
    StandingsFrame,
    encode_events,
    encode_standings,
)

REAL, LOCKSTEP = "real", "lockstep"
STANDINGS_TICKS = ticks_of(0.5)
# In lock-step a driver that does not answer for so long is treated as gone.
ANSWER_S = 10.0
# … and it is told again what it sees as often as this, should a message have been lost.
REPEAT_S = 0.5
LOBBY_POLL_S = 0.02
# A seat is given away again if its driver's link does not show up in the lobby for so long.
SHOW_UP_S = 10.0


@dataclass(frozen=True)
class RaceResult:
    """What is left of a race."""

    digest: str
    ticks: int
    standings: list[Standing]
    events: list[Event]
    missed_ticks: int
    refused: dict[str, int]

    def as_json(self) -> dict[str, Any]:
        """Return the result as plain data: the document that `--json` prints."""
        karts = []
        for row in self.standings:
            kart = asdict(row)
            kart["lap_times_us"] = list(row.lap_times_us)
            kart["status"] = row.status.name.lower()
            karts.append(kart)
        return {
            "digest": self.digest,
            "ticks": self.ticks,
            "karts": karts,
            "events": [{**asdict(event), "kind": event.kind.name.lower()} for event in self.events],
            "missed_ticks": self.missed_ticks,
            "refused": self.refused,
        }


@dataclass
class RaceServer:
    """One session on the network."""

    session: Session
    link: ServerLink
    pace: str = REAL
    fillers: tuple[str, ...] = ()  # drivers for the seats that stay empty, repeated in turn
    results: Writer | None = None  # the file that keeps races and laps
    missed_ticks: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Prepare the writers."""
        self._snapshots = SnapshotWriter()
        self._observations: dict[int, ObservationWriter] = {}
        self._keeper = Keeper(self.results) if self.results else None
        self._paddock = Paddock(self.session)
        self._stop = False
        self._linked: set[int] = set()  # seats whose driver's link is there
        self._expected: dict[int, float] = {}  # seats whose link is not there yet, since when

    # One race from the lobby to the results

    def run(self, drivers: int) -> RaceResult | None:
        """Wait until `drivers` drivers are ready, race, and return the result.

        Who is stopped in the lobby has no result.
        """
        self.wait_in_lobby(drivers)
        if self._stop:
            return None
        self._fill_empty_seats()
        return self.race()

    def stop(self) -> None:
        """End the race at the next tick; what was driven counts."""
        self._stop = True

    def reopen(self) -> None:
        """Go back to the lobby after a race; the seats that were filled are free again."""
        self.session.reopen()
        self._paddock.clear()
        self._tell_standings()

    def wait_in_lobby(self, drivers: int) -> None:
        """Serve the lobby until `drivers` seats are taken and all who sit there are ready."""
        while not self._stop:
            self._hear()
            self._free_deserted_seats()
            taken = sum(seat.is_taken for seat in self.session.seats)
            if taken >= drivers and (taken == 0 or self.session.can_start()):
                return
            self.link.wait(LOBBY_POLL_S)

    def _free_deserted_seats(self) -> None:
        now = time.monotonic()
        for seat, joined in list(self._expected.items()):
            if now - joined > SHOW_UP_S:
                del self._expected[seat]
                self.session.drop(seat)

    def race(self) -> RaceResult:
        """Run one race from the countdown to the last kart's finish."""
        self.session.start()
        self.events = list(self.session.recent)
        if self._keeper:
            self._keeper.begin(self.session, self.pace)
        self._tell_standings()
        gc.collect()
        gc.freeze()
        gc.disable()
        try:
            if self.pace == LOCKSTEP:
                self._race_in_lockstep()
            else:
                self._race_in_real_time()
        finally:
            gc.enable()
            gc.unfreeze()
            self._close_book()
        self._tell_seats()
        self._tell_watchers()
        self._tell_standings()
        return RaceResult(
            self.session.digest(),
            self.session.tick,
            self.session.standings(),
            self.events,
            self.missed_ticks,
            self._refusals(),
        )

    def _close_book(self) -> None:
        """Tell the last events and write how the race ended."""
        if self._keeper:
            self._tell_released(self._keeper, wait=True)
            self._keeper.end(self.session)

    def _refusals(self) -> dict[str, int]:
        """Return how many messages were refused, by reason."""
        counts = dict(self.refused)
        for reason in ("oversized", "foreign"):
            if count := getattr(self.link, reason):
                counts[reason] = count
        return counts

    def _race_in_real_time(self) -> None:
        pacer = Pacer()
        pacer.start()
        session = self.session
        while self._goes_on():
            if session.tick % session.decision_ticks == 0:
                self._tell_seats()
            self._hear()
            self._advance(1)
            pacer.wait()
        self.missed_ticks += pacer.missed

    def _race_in_lockstep(self) -> None:
        while self._goes_on():
            self._tell_seats()
            self._hear_all()
            self._advance(self.session.decision_ticks)

    def _goes_on(self) -> bool:
        return not self._stop and self.session.phase in {Phase.COUNTDOWN, Phase.RUNNING}

    def _advance(self, ticks: int) -> None:
        before = self.session.tick
        if self._keeper:
            self._keeper.look(self.session)
        events = self.session.advance(ticks)
        self.events += events
        self._announce(events)
        self._tell_watchers()
        if before // STANDINGS_TICKS != self.session.tick // STANDINGS_TICKS:
            self._tell_standings()

    def _announce(self, events: list[Event]) -> None:
        """Tell events in order; a lap, and what comes after it, once it is in the results file.

        In real time no tick waits for the file. In lock-step the world does, as for a driver.
        """
        if self._keeper:
            self._keeper.keep(events)
            self._tell_released(self._keeper, wait=self.pace == LOCKSTEP)
        elif events:
            self._tell_events(events)

    def _tell_released(self, keeper: Keeper, *, wait: bool) -> None:
        for events in keeper.released(wait=wait):
            self._tell_events(events)

    def _tell_events(self, events: list[Event]) -> None:
        self.link.publish(topics.EVENTS, encode_events(self.session.epoch, events))

    # Hearing

    def _hear_all(self) -> None:
        """Wait for the answer of every seat; who is silent too long is gone."""
        deadline = time.monotonic() + ANSWER_S
        again = time.monotonic() + REPEAT_S
        while True:
            self._hear()
            waiting = self.session.waits_for()
            if not waiting or self._stop:
                return
            now = time.monotonic()
            if now > deadline:
                for seat in waiting:
                    self.session.drop(seat)
                return
            if now > again:
                again = now + REPEAT_S
                for seat in waiting:
                    self._send_observation(self.session.seats[seat])
            self.link.wait(0.05)

    def _hear(self) -> None:
        for seat, data in self.link.take_inputs():
            self._take_control(seat, data)
        for request in self.link.take_requests():
            self._answer(request)
        for seat, is_there in self.link.take_presence():
            self._take_presence(seat, is_there=is_there)

    def _take_control(self, seat: int, data: bytes) -> None:
        try:
            frame = decode_control(data)
            self.session.take_control(seat, frame.epoch, frame.sequence, frame.tick, frame.control)
        except WireError as error:
            self.refused[_reason(error)] += 1

    def _take_presence(self, seat: int, *, is_there: bool) -> None:
        if seat in self._paddock:
            return
        if is_there:
            self._linked.add(seat)
            self._expected.pop(seat, None)
        else:
            self._linked.discard(seat)
            self.session.drop(seat)

    def _answer(self, request: Request) -> None:
        try:
            request.answer(self._answer_to(request))
        except (WireError, SeatError) as error:
            self.refused[_reason(error)] += 1
            request.answer(encode_reply(str(error)))

    def _answer_to(self, request: Request) -> bytes:
        session = self.session
        if request.topic is topics.JOIN:
            join = decode_join(request.payload)
            seat = session.join(join.driver, join.preset, wanted=join.wanted, secret=join.secret)
            if session.phase is Phase.LOBBY and seat.number not in self._linked:
                self._expected[seat.number] = time.monotonic()
            return encode_welcome(self._welcome(seat))
        if request.topic in {topics.READY, topics.LEAVE}:
            act = decode_seat_act(request.payload)
            seat = session.seat(act.seat)
            if act.secret != seat.secret:
                raise SeatError(f"seat {act.seat} is not yours: the secret does not fit")
            if request.topic is topics.LEAVE:
                session.leave(act.seat)
            else:
                seat.is_ready = act.ready
            return encode_reply("")
        if request.topic is topics.COURSE:
            return encode_course(self._course())
        if request.topic is topics.RULES:
            return encode_rules(self._rules(), [item.name for item in items()])
        if request.topic is topics.RECENT:
            recent = list(session.recent)
            return encode_events(
                session.epoch, self._keeper.told(recent) if self._keeper else recent
            )
        return encode_standings(self._standings())

    # Telling

    def _tell_seats(self) -> None:
        """Send every seat what it sees, and let the local drivers answer at once."""
        session = self.session
        session.look()
        for seat in session.seats:
            if not seat.is_taken:
                continue
            if seat.number in self._paddock:
                self._drive_locally(seat)
            elif seat.is_present:
                self._send_observation(seat)
                self.link.publish(topics.HUD, encode_hud(self._hud(seat)), seat.number)

    def _send_observation(self, seat: Seat) -> None:
        self.link.publish(topics.OBSERVATION, self._observation(seat), seat.number)

    def _observation(self, seat: Seat) -> bytes:
        values = self.session.view(seat.number)
        writer = self._observations.get(len(values))
        if writer is None:
            writer = self._observations[len(values)] = ObservationWriter(len(values))
        return writer.write(
            self.session.epoch, self.session.tick, seat.sequence, seat.number, values
        )

    def _hud(self, seat: Seat) -> HudFrame:
        tick, kart = self.session.tick, self.session.world.karts[0, seat.number]
        acting = [effect for effect in kart.effects if effect["source"] > 0]
        effects = np.zeros(len(acting), EFFECT)
        for row, effect in zip(effects, acting, strict=True):
            row["item"] = effect["source"]
            row["remaining"] = max(effect.until_tick - tick, 0) / TICKS_PER_SECOND
        immune = max(int(kart.immune_until), int(kart.shield_until)) - tick
        return HudFrame(
            epoch=self.session.epoch,
            tick=tick,
            speed_cap=float(kart.speed_cap),
            thrust_scale=float(kart.thrust_scale),
            grip_scale=float(kart.grip_scale),
            item=int(kart.held),
            immune_s=max(immune, 0) / TICKS_PER_SECOND,
            effects=effects,
        )

    def _tell_watchers(self) -> None:
        self.link.publish(topics.SNAPSHOT, self._snapshots.write(self.snapshot()))

    def snapshot(self) -> SnapshotFrame:
        """Return the race as spectators see it now."""
        session, world = self.session, self.session.world
        race, tick = world.races[0], session.tick
        rows = world.karts[0]
        karts = np.zeros(len(rows), KART)
        for name in _SAME_NAMES:
            karts[name] = rows[name]
        karts["item"] = rows["held"]
        karts["seat"] = np.arange(len(rows))
        karts["acknowledged"] = [seat.sequence for seat in session.seats]
        karts["effects"] = (rows["effects"]["source"] > 0).sum(axis=1) if EFFECTS else 0
        safe = np.maximum(rows["immune_until"], rows["shield_until"]) > tick
        karts["flags"] = (
            rows["wrong_way"] + 2 * rows["off_track"] + 4 * rows["rescue_offered"] + 8 * safe
        )
        placed = world.hazards[0][world.hazards["until_tick"][0] > tick]
        hazards = np.zeros(len(placed), HAZARD)
        for name in ("x", "y", "radius", "owner"):
            hazards[name] = placed[name]
        hazards["item"] = placed["source"]
        lights = max(int(race.start_tick), int(race.hold_until)) - tick
        return SnapshotFrame(
            monotonic_us=time.monotonic_ns() // 1000,
            epoch=session.epoch,
            tick=tick,
            lights_s=max(lights, 0) / TICKS_PER_SECOND,
            phase=session.phase,
            flag=Flag(int(race.flag)),
            karts=karts[rows["status"] != codes.ABSENT],
            boxes=(world.boxes["ready_tick"][0] <= tick).astype(np.uint8),
            hazards=hazards,
        )

    def _tell_standings(self) -> None:
        self.link.publish(topics.STANDINGS, encode_standings(self._standings()))

    def _standings(self) -> StandingsFrame:
        session = self.session
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

    def _welcome(self, seat: Seat) -> Welcome:
        briefing = briefing_for(self.session, seat)
        return Welcome(briefing, seat.secret, self.session.epoch, self.session.scenario.lidar.rays)

    def _course(self) -> CourseSheet:
        course = self.session.scenario.course
        return CourseSheet(
            name=course.name,
            title=course.title,
            digest=course.digest,
            spacing=course.spacing,
            line=course.line,
            half_widths=course.half_widths,
            kerb=course.kerb,
            borders=course.borders,
            gates=course.gates,
            grid=course.grid,
            boxes=course.spots,
        )

    def _rules(self) -> dict[str, str]:
        rules = asdict(self.session.scenario.rules)
        return {name: str(value) for name, value in rules.items()}

    # Seats that are driven from inside

    def _fill_empty_seats(self) -> None:
        """Let scripted drivers take the empty seats from inside the server."""
        for seat in list(self.session.seats):
            if self.fillers and not seat.is_taken:
                name = self.fillers[seat.number % len(self.fillers)]
                self._paddock.admit(name, driver_named(name), seat.number)

    def _drive_locally(self, seat: Seat) -> None:
        try:
            control = self._paddock.answer(seat.number)
        except DriverError:
            self.refused[f"driver {seat.driver} failed"] += 1
            self.session.drop(seat.number)
            return
        self._take_control(seat.number, control)


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


def _reason(error: Exception) -> str:
    """Return what kind of refusal an error is, without the numbers that differ each time."""
    words = str(error).split(":", 1)[0]
    return " ".join(word for word in words.split() if not any(c.isdigit() for c in word))[:60]
