"""The program of a real kart: takes a seat, reports poses, applies controls, keeps the kart safe.

This is the game's side: link, driver, report. What moves and keeps safe is the other side,
`race_agents.onboard.safety_side`, in a separate process.
"""

import math
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import replace
from functools import partial

from race_agents.onboard.beside import Beside
from race_agents.onboard.crew import Crew
from race_agents.onboard.helped import HelpedDriver
from race_agents.onboard.kart import Kart
from race_agents.onboard.parker import PRESET, Parker
from race_agents.onboard.peers import Peers
from race_agents.onboard.program import PERIOD_S, RETRY_S, Clock, KartProgram, KnownKart
from race_agents.unit.records import Word
from race_server.coaching.assistance import Guide, Level
from race_server.core.clock import Pacer
from race_server.core.driver import Briefing, Driver, ParkingDriver, driver_named
from race_server.core.vehicles import Vehicle
from race_server.errors import DriverError
from race_server.live.client.seat import ClientSeat, insist, take_seat
from race_server.net.auth.keys import ClientKeys
from race_server.net.auth.settings import PeerSettings
from race_server.net.transport import ClientLink, PeerLink
from race_server.net.wire import topics
from race_server.net.wire.line import decode_line
from race_server.net.wire.lobby import CourseSheet, Join, Welcome, decode_course, decode_rules
from race_server.net.wire.parking import OrderFrame
from race_server.net.wire.sheets import VEHICLES

# After this time without a word of the server it gives up.
GIVE_UP_S = 10.0
# The driver that parks, where none is named.
VALET = "valet"


def take_part(
    driver: Driver,
    kart_of: Callable[[ClientSeat, CourseSheet, ClientLink], Kart],
    *,
    name: str,
    address: str,
    session: str = "race",
    keys: ClientKeys | None = None,
    wanted: int = -1,
    timeout_s: float = 20.0,
    delay_s: float = 0.0,
    clock: Clock = time.monotonic,
    caution: float = 1.0,
    valet: str = VALET,
    on_request: bool = False,
    beside: str = "",
    peers: tuple[str, ...] = (),
    level: Level = Level.NONE,
    each_turn: Callable[[KartProgram, Kart, float], bool] = lambda *_: True,
) -> None:
    """Drive one race with a real kart, all of an event, or park it.

    kart_of: is called before each race, when the kart stands on its place on the grid; in an event
    once the race counts down. driver: one that parks goes to its slot in a car park; any other
    races, and hands the wheel to `valet` when the server orders the kart to park. caution: share of
    the tyres' grip that the driver is told of. on_request: a driver that parks waits for an order
    of the server, too. beside: address of this machine at which programs are told what the kart
    knows, "" for none. level: of the help for a racing driver's pedals. each_turn: is called after
    each turn of the game's side; the kart leaves once it returns False, or is through.

    Raises:
        LinkError: no server, or one that is gone before the race begins.
        SeatError: no seat.
        DriverError: the driver that is to park cannot.
    """
    with ExitStack() as left:
        link = left.enter_context(ClientLink(address, session, keys=keys, timeout_s=timeout_s))
        persist = partial(insist, deadline=time.monotonic() + timeout_s)
        join = Join(name[:32], driver.preset, wanted, tracked=True)
        seat = persist(partial(take_seat, link, join))
        onboard = KartProgram(seat, clock, delay_s)
        if beside:
            onboard.beside = left.enter_context(closing(Beside(beside, session, seat.number)))
        if peers:
            meet = PeerSettings(peers[0], peers[1:], session, seat.number, keys)
            onboard.peers = left.enter_context(closing(_among(meet, clock)))
        link.listen(topics.HUD, onboard.store, seat.number)
        welcome = onboard.next_race(None) if seat.welcome.stays else seat.welcome
        while welcome is not None:
            persist = partial(insist, deadline=time.monotonic() + timeout_s)
            sheet = decode_course(persist(partial(link.ask, topics.COURSE)))
            guide = _guide(link, driver, level, welcome.briefing.vehicle, caution)
            kart, known = kart_of(seat, sheet, link), KnownKart(welcome.briefing.vehicle)
            briefing = _stating(welcome.briefing, caution)
            racer = HelpedDriver(driver, level, guide, known, clock) if guide else driver
            crew_of = partial(_crew_of, racer, name, valet, briefing, welcome, sheet)
            parks = None if on_request else welcome.order
            ready = None if welcome.stays else partial(persist, partial(seat.act, topics.READY))
            _drive(partial(_crew_ready, crew_of, parks, ready), onboard, kart, known, each_turn)
            welcome = onboard.next_race(known.hud)


def _guide(
    link: ClientLink, driver: Driver, level: Level, vehicle: Vehicle, caution: float
) -> Guide | None:
    """Return the line that help for the pedals follows, None without help.

    Its speeds are those for a share of the tyres' grip, as the driver is told of it.

    Raises:
        DriverError: there is none for this vehicle.
    """
    if level < Level.BRAKES or isinstance(driver, ParkingDriver):
        return None
    rules, line = decode_rules(link.ask(topics.RULES))[0], decode_line(link.ask(topics.LINE))
    whose = rules.get(VEHICLES, "").split(",")[0] if len(line.x) else "no vehicle"
    if whose != vehicle.name:
        raise DriverError(
            f"the server has a line for {whose}, and this kart is a {vehicle.name}: drive without "
            "help for the pedals"
        )
    return Guide(replace(line, speed=math.sqrt(caution) * line.speed))


def _among(meet: PeerSettings, clock: Clock) -> Peers:
    """Return the other karts, told and heard at a link of peers."""
    peers = Peers(meet.seat)
    peers.radio = PeerLink(meet, lambda seat, data: peers.store(seat, data, clock()))
    return peers


def _stating(briefing: Briefing, caution: float) -> Briefing:
    """Return a briefing that states a share of the tyres' grip."""
    vehicle = briefing.vehicle
    return replace(briefing, vehicle=replace(vehicle, grip=caution * vehicle.grip))


def _crew_of(
    driver: Driver, name: str, valet: str, briefing: Briefing, welcome: Welcome, sheet: CourseSheet
) -> Crew:
    """Return the drivers, each with its briefing."""
    races_first = len(sheet.line) > 0
    if isinstance(driver, ParkingDriver) and driver.preset == PRESET:
        return Crew(None, Parker(driver, name, briefing, welcome.lidar_rays), races_first)
    driver.reset(briefing)
    if races_first and not len(sheet.slots):
        return Crew(driver)
    parker = Parker(driver_named(valet), valet, briefing, welcome.lidar_rays)
    return Crew(driver, parker, races_first)


def _crew_ready(
    crew_of: Callable[[], Crew], order: OrderFrame | None, ready: Callable[[], object] | None
) -> Crew:
    """Return the drivers once they and the server know that all are ready.

    order: to park, None where there is none yet; ready: tells the server.
    """
    crew = crew_of()
    if crew.parker is not None:
        crew.parker.take(order, stands=True)
    try:
        if ready is not None:
            ready()
    except BaseException:
        crew.close()
        raise
    return crew


def _drive(
    crew_ready: Callable[[], Crew],
    onboard: KartProgram,
    kart: Kart,
    known: KnownKart,
    goes_on: Callable[[KartProgram, Kart, float], bool],
) -> None:
    """Turn 50 times a second; however this ends, the kart is left with its brakes on."""
    with ExitStack() as left:
        left.callback(onboard.close)
        with closing(kart):
            crew = crew_ready()
            left.callback(crew.close)
            _turn(crew, onboard, kart, known, goes_on)


def _turn(
    crew: Crew,
    onboard: KartProgram,
    kart: Kart,
    known: KnownKart,
    goes_on: Callable[[KartProgram, Kart, float], bool],
) -> None:
    pacer, word = Pacer(PERIOD_S), Word()
    pacer.start()
    heard_s = asked = onboard.answered_s = onboard.clock()
    while known.hud is None or onboard.clock() - heard_s < GIVE_UP_S:
        now = onboard.clock()
        if (heard := onboard.hear(now)) is not None:
            known.hud, known.hud_s = heard
            word = replace(word, orders=known.hud, heard_s=known.hud_s)
            heard_s = asked = now
        decided = crew.act(onboard.see(), onboard.receive_order(), known, now)
        if decided is not None:
            word = replace(word, control=decided, decisions=word.decisions + 1)
        word = replace(word, peers=onboard.hear_peers(known, now))
        kart.tell(word, now)
        kart.turn(now)
        if (report := kart.report()) is not None:
            known.report, onboard.is_cut = report, onboard.is_cut or report.is_cut
        onboard.tell(known, now)
        if known.report.is_through or not goes_on(onboard, kart, now):
            return
        if now - asked > RETRY_S and not onboard.is_cut:
            asked = now
            onboard.ask_again(waits=known.hud is None)
        if known.hud is None:  # others may not be ready yet: it waits for as long as answers come
            onboard.expect_answers(now)
        pacer.wait()
