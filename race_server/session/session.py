"""A race session, from the lobby to the results."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from race_server.core import codes
from race_server.core.kernels.jit import bind
from race_server.core.messages import Button, Control, Event, Phase, Pose, PoseFault, Standing
from race_server.core.observation import Layout, layout_of
from race_server.core.parking_order import ParkingOrder
from race_server.core.state import Float32s, Floats, World, digest
from race_server.core.step import advance, place_karts
from race_server.errors import Reason, WireError
from race_server.scenario.race import ABSENT, Scenario, line_up_race, make_world
from race_server.session.controls import Controls
from race_server.session.event_log import EventLog
from race_server.session.failsafe import STOP
from race_server.session.interventions import Intervention, InterventionKind
from race_server.session.journal_entries import Entry, Inputs, JournalEntries
from race_server.session.observations import Observations, fitted_for
from race_server.session.parking import has_lot, standing_orders_of
from race_server.session.race_control import RaceControl
from race_server.session.replay_guard import ReplayGuard
from race_server.session.seating import Newcomer, free_seat, known_seat
from race_server.session.seats import Seat, Seats
from race_server.session.standings import table_of
from race_server.session.tracked.karts import Placements, TrackedKarts


@dataclass
class Session:
    """One race session on one scenario; each race in it is an epoch."""

    name: str
    scenario: Scenario
    decision_ticks: int = 3
    phase: Phase = Phase.LOBBY
    epoch: int = 0
    takes_tracked: bool = True  # where the world waits for drivers no real kart can take part
    is_event: bool = False  # drivers stay after a race
    keeps_seats: bool = False  # the event has begun: its drivers have their seats to its end
    journal: JournalEntries = field(default_factory=JournalEntries)
    replay_guard: ReplayGuard = field(default_factory=ReplayGuard)  # of requests that were granted
    event_log: EventLog = field(default_factory=EventLog)
    seats: Seats = field(init=False)
    world: World = field(init=False)
    standing_orders: list[ParkingOrder] = field(init=False)  # by seat, none without a car park
    tracked_karts: TrackedKarts = field(init=False)
    race_control: RaceControl = field(init=False)

    def __post_init__(self) -> None:
        """Begin with free seats."""
        self.seats = Seats(self.scenario.karts)
        self.prepare(self.scenario)

    def prepare(self, scenario: Scenario) -> None:
        """Build the world of the next races, on as many seats; each start puts it back."""
        self.scenario = scenario
        self.world = make_world(scenario)
        self.standing_orders = standing_orders_of(self.world)
        self.tracked_karts = TrackedKarts(scenario.course)
        for seat in self.seats.taken():
            if seat.is_tracked:
                self.tracked_karts.admit(seat.number, scenario.vehicle_of(seat.number))
        parts = self.world, self.seats, self.event_log, self.journal
        self.race_control = RaceControl(*parts, self.leave)
        self._controls = Controls(scenario, self.decision_ticks)
        self._observations = Observations(scenario.karts, scenario.lidar.rays)
        self._advances: dict[int, Callable[[], None]] = {}

    # Drivers and their seats

    def join(
        self,
        driver: str,
        preset: str,
        *,
        wanted: int = -1,
        secret: int = 0,
        tracked: bool = False,
        owns: bool = False,
    ) -> Seat:
        """Give a driver a seat, or the one that it already has.

        secret: chosen by the driver; the same one is given the same seat again. owns: the wanted
        seat is known to be the driver's, which may take it with a new secret once its old link is
        gone. tracked: a real kart.

        Raises:
            SeatError: no seat is free for it, the race has begun, or the event is over.
        """
        newcomer = Newcomer(driver, preset, wanted, secret, tracked, owns)
        racing = self.lined_up() if self.is_on else []
        kept = {"in_event": self.keeps_seats, "is_over": not self.is_event}
        if known := known_seat(newcomer, self.seats, racing, **kept):
            return known
        is_lobby = self.phase is Phase.LOBBY
        seat = free_seat(newcomer, self.seats, is_lobby=is_lobby, takes_tracked=self.takes_tracked)
        seat.assign(driver, preset, secret, is_tracked=tracked)
        if tracked:
            self.tracked_karts.admit(seat.number, self.scenario.vehicle_of(seat.number))
        return seat

    def seat(self, number: int) -> Seat:
        """Return a taken seat.

        Raises:
            SeatError: it is not taken.
        """
        return self.seats.taken_one(number)

    def leave(self, number: int) -> None:
        """Free a seat in the lobby; in a race its kart stops and is out."""
        seat = self.seat(number)
        if self.is_on and seat in self.lined_up():
            self.race_control.intervene(InterventionKind.WITHDRAW, number)
            seat.is_present = False
            seat.control = STOP
        else:
            self._free(number)

    def drop(self, number: int) -> None:
        """Record that a driver's link is gone: its kart is brought to a safe stop."""
        seat = self.seats[number]
        if seat.is_taken and self.phase is Phase.LOBBY:
            self._free(number)
        elif seat.is_taken and seat.is_present:
            seat.is_present = False
            seat.away_since = self.tick

    def come_back(self, number: int) -> None:
        """Record that a driver is there again."""
        self.seat(number).come_back()

    def _free(self, number: int) -> None:
        """Free a seat; in an event it stays its driver's, which may come back."""
        if self.keeps_seats:
            self.seats[number].is_present = self.seats[number].is_ready = False
            return
        self.seats.free(number)
        self.tracked_karts.dismiss(number)

    # From the lobby to the race and back

    @property
    def tick(self) -> int:
        """The tick that comes next."""
        return int(self.world.races[0].tick)

    @property
    def is_on(self) -> bool:
        """Whether karts count down or race."""
        return self.phase in {Phase.COUNTDOWN, Phase.RUNNING}

    def is_racing(self, number: int) -> bool:
        """Return whether a race is on and the kart of a seat is still in it."""
        return self.is_on and int(self.world.bodies["status"][0, number]) == codes.RACING

    def lined_up(self) -> list[Seat]:
        """Return the taken seats that take part in the race, or in the next one."""
        order = self.scenario.grid_order
        return [seat for seat in self.seats.taken() if not order or order[seat.number] != ABSENT]

    def can_start(self) -> bool:
        """Return whether the lobby has drivers and all of them are ready."""
        taken = self.seats.taken()
        return self.phase is Phase.LOBBY and bool(taken) and all(seat.is_ready for seat in taken)

    def start(self, now_us: int = 0) -> None:
        """Line up and count down in a new epoch. now_us: of the clock that real karts are on."""
        self.epoch += 1
        self.journal.drain()
        self.race_control.is_paused = False
        fitted = tuple(fitted_for(seat, parks=has_lot(self.world)) for seat in self.seats)
        line_up_race(self.world, 0, replace(self.scenario, fitted=fitted), self.scenario.seed)
        for seat in self.seats:
            seat.line_up()
        self._controls.clear()
        self._observations.begin(self.lined_up())
        self.event_log.begin(self.world)
        self.tracked_karts.begin(self.world, now_us)
        self._enter_phase(Phase.COUNTDOWN)

    def reopen(self) -> None:
        """Go back to the lobby after a race; the seats of drivers that have gone are free."""
        for seat in list(self.seats):
            seat.is_ready &= self.keeps_seats  # in an event long before it is their turn
            if not seat.is_present:
                self._free(seat.number)
        self._enter_phase(Phase.LOBBY)

    def _enter_phase(self, phase: Phase) -> Event:
        self.phase = phase
        return self.event_log.enter_phase(self.world, phase)

    # What drivers send

    def receive_control(
        self, number: int, epoch: int, sequence: int, tick: int, control: Control
    ) -> None:
        """Receive the newest control of a seat.

        Raises:
            WireError: it belongs to another epoch, is a replay, or answers the future.
        """
        seat = self.seats[number]
        if seat.is_tracked:
            raise WireError(f"control of seat {number}, which is a real kart", Reason.KART_KIND)
        self._check_sequence(seat, "control", epoch, sequence)
        if tick > self.tick:
            raise WireError(f"control answers tick {tick}, this is tick {self.tick}", Reason.FUTURE)
        if seat.is_led:
            seat.sequence = sequence  # heard, but another driver has the wheel
            return
        seat.answered_tick = tick
        seat.receive(sequence, control, self.tick)

    def receive_pose(
        self,
        number: int,
        epoch: int,
        sequence: int,
        pose: Pose,
        *,
        arrived_us: int,
        acknowledged: int = 0,
        buttons: Button = Button.NONE,
    ) -> PoseFault:
        """Receive a pose of a real kart and return its fault.

        Raises:
            WireError: the kart is simulated, or the pose of another epoch or a replay.
        """
        seat = self.seats[number]
        if not seat.is_tracked:
            raise WireError(f"pose of seat {number}, whose kart is simulated", Reason.KART_KIND)
        self._check_sequence(seat, "pose", epoch, sequence)
        # The kart moves by its poses; of a control only the buttons are left.
        seat.receive(sequence, replace(STOP, buttons=buttons), self.tick)
        self.tracked_karts.orders(number).acknowledge(acknowledged, arrived_us)
        return self.tracked_karts.receive(number, pose, arrived_us)

    def _check_sequence(self, seat: Seat, what: str, epoch: int, sequence: int) -> None:
        if not seat.is_taken or epoch != self.epoch:
            raise WireError(f"{what} for epoch {epoch}, this is epoch {self.epoch}", Reason.EPOCH)
        if sequence <= seat.sequence:
            raise WireError(f"{what} {sequence} again, already at {seat.sequence}", Reason.AGAIN)

    def waits_for(self) -> list[int]:
        """Return the racing seats whose drivers have the wheel and have not yet answered."""
        driving = (seat for seat in self.seats.taken() if seat.is_present and not seat.is_led)
        late = [seat.number for seat in driving if seat.answered_tick < self.tick]
        return [number for number in late if self.is_racing(number)]

    # Time passes

    def follow(self, now_us: int) -> None:
        """Put the real karts where they are at this time, right before a tick."""
        if self.tracked_karts.trackers:
            self.place_karts(self.tracked_karts.follow(self.world, now_us))

    def place_karts(self, placements: Floats) -> None:
        """Put karts into the world. placements: (n, 10), see state.PLACEMENT.

        All that real karts do to the world goes through here, for the same race in a replay.
        """
        if not len(placements):
            return
        if self.journal.is_recorded:
            self.journal.add(self.tracked_karts.placed(self.tick, placements))
        place_karts(self.world, 0, placements)

    def advance(self, ticks: int = 1) -> list[Event]:
        """Move the race on and return what happened.

        The same control acts for all `ticks`; see `race_server.session.failsafe` for karts whose
        driver is silent.
        """
        tick, statuses = self.tick, self.world.bodies["status"][0]
        for seat in self.seats.taken():
            if seat.is_gone(tick) and statuses[seat.number] == codes.RACING:
                self.race_control.intervene(InterventionKind.WITHDRAW, seat.number)
                seat.away_since = -1
        if inputs := self._controls.load(self.seats, self.world):
            self.journal.add(inputs)
        return self.move(ticks)

    def move(self, ticks: int) -> list[Event]:
        """Move the race on under the controls that act already, and return what happened."""
        if ticks not in self._advances:
            self._advances[ticks] = bind(advance, self.world, self._controls.acting, ticks)
        self._advances[ticks]()
        events = self.event_log.collect(self.world)
        if self.phase is Phase.COUNTDOWN and self.tick > self.world.races[0].start_tick:
            events.append(self._enter_phase(Phase.RUNNING))
        if self.phase is Phase.RUNNING and self.world.races[0].over:
            events.append(self._enter_phase(Phase.FINISHED))
        return events

    # What a recording holds

    def repeat(self, entry: Entry) -> None:
        """Apply an entry of a recording."""
        if isinstance(entry, Inputs):
            self._controls.recall(entry)
            for seat, sequence in zip(entry.seats, entry.sequences, strict=True):
                self.seats[seat].sequence = int(sequence)
        elif isinstance(entry, Placements):
            place_karts(self.world, 0, entry.rows)
            self.tracked_karts.recall(entry)
        elif isinstance(entry, Intervention):
            self.race_control.repeat(entry)
        else:
            self.replay_guard.record(entry.key, entry.serial)

    # What drivers and spectators are sent

    def observe(self) -> None:
        """Compute the observations of all seats now; read them with `view`."""
        self._observations.compute(self.world)

    def view(self, number: int) -> Float32s:
        """Return the observation vector of a seat as of the last `observe`."""
        return self._observations.of(number)

    def acting(self, number: int) -> Float32s:
        """Return the control that acts on the kart of a seat, or acted last, shape (4,).

        It is steering, throttle, brake, buttons: what the driver gave, or what its silence made.
        """
        return self._controls.acting[0, number].astype(np.float32)

    def layout(self, preset: str) -> Layout:
        """Return the layout of a preset in this session."""
        return layout_of(preset, self.scenario.lidar.rays)

    def standings(self) -> list[Standing]:
        """Return one row for each seat that takes part, best place first."""
        there = {seat.number for seat in self.lined_up()}
        return sorted((row for row in self.table() if row.seat in there), key=lambda row: row.rank)

    def table(self) -> list[Standing]:
        """Return one row for each seat, taken or not."""
        return table_of(self.seats, self.world, self.event_log)

    def digest(self) -> str:
        """Return the digest of the world."""
        return digest(self.world)
