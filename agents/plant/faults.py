"""What may fail in a kart, and what has to happen then: it goes on, crawls, or stops."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from race_agents.plant.faulty import Change, Fault, Scene
from race_agents.plant.sensors import Sensors
from race_agents.unit.readings import Fix, Readings
from race_agents.unit.safety import Echoes
from race_server.core.alert import Cause

NAN = math.nan
# A sensor that has failed shows within this time [s].
SHOWS_S = 0.6
# … one that hangs while the kart stands once it drives, 1 s later, and has driven a second.
HANGS_S = 2.5
# … and so far [m] the kart came by then without any wheels that tell it.
PINNED_M = 2.5
# A place of satellites with corrections is off by this [m] at most, where it is not said otherwise.
OFF_M = 0.5
# … and by this [m], a kart's width, where what tells it has failed.
KART_M = 1.3


class Then(Enum):
    """What a kart does after something has failed."""

    STOPS = "stops"  # with full brakes, at once
    HALTS = "halts"  # without a motor, then with 60 % of its brakes
    CRAWLS = "crawls"
    GOES_ON = "goes on"


@dataclass(frozen=True)
class Case:
    """A fault and what must happen."""

    fault: Fault
    then: Then
    shows: str = ""  # sensor and state as they have to be told
    cause: Cause = Cause.NONE  # of what the kart does by itself
    off_m: float = OFF_M  # how far off its place may be at most
    shows_s: float = SHOWS_S


def _fix(change: Callable[[Fix, Scene], Fix | None]) -> Change:
    def readings_of(readings: Readings, scene: Scene) -> Readings:
        fix = readings.fix
        return readings if fix is None else replace(readings, fix=change(fix, scene))

    return readings_of


def _set(**values: Any) -> Change:
    return lambda readings, _: replace(readings, **values)


def _hangs(name: str) -> Change:
    """Return that a sensor repeats what it said first."""

    def readings_of(readings: Readings, scene: Scene) -> Readings:
        now = getattr(readings, name)
        if now is None:  # it says nothing at each turn
            return readings
        return replace(readings, **{name: scene.first(name, now)})

    return readings_of


def _same_place(fix: Fix, scene: Scene) -> Fix:
    was = scene.first("fix", fix)
    return replace(fix, x=was.x, y=was.y)


def _reflected(fix: Fix, scene: Scene) -> Fix:
    """Return three of ten fixes 2 to 20 m beside."""
    number = scene.kept["fixes"] = scene.kept.get("fixes", 0) + 1
    if number % 10 not in {2, 5, 8}:
        return fix
    far = 2.0 + 2.0 * (number % 10)
    return replace(fix, x=fix.x + far * math.cos(number), y=fix.y + far * math.sin(number))


def _spoilt(readings: Readings, _: Scene) -> Readings:
    echoes = readings.echoes
    if echoes is None:
        return readings
    none = np.full(len(echoes.x), NAN)
    return replace(readings, echoes=Echoes(none, none, none, echoes.kinds))


def _stamped(by_s: float) -> Callable[[Fix, Scene], Fix]:
    return lambda fix, _: replace(fix, stamp_s=(fix.stamp_s or 0.0) + by_s)


def _lost(readings: Readings, _: Scene) -> Readings:
    return replace(readings, fix=None, beacons=())


def _far(readings: Readings, _: Scene) -> Readings:
    """Return the ranges alone, those to one beacon too long."""
    liar = BEACONS.beacons[0]
    ranges = (
        replace(each, distance=each.distance + 5.0 * ((each.x, each.y) == liar))
        for each in readings.beacons
    )
    return replace(readings, fix=None, beacons=tuple(ranges))


def _late(readings: Readings, scene: Scene) -> Readings:
    """Return the fix of 0.4 s before: the receiver has fallen behind, and does not say so."""
    queue = scene.kept.setdefault("queue", [])
    if readings.fix is not None:
        queue.append((readings.time_s + 0.4, replace(readings.fix, stamp_s=None)))
    due = queue.pop(0)[1] if queue and queue[0][0] <= readings.time_s else None
    return replace(readings, fix=due)


BEACONS = Sensors(beacons=((-60.0, -60.0), (60.0, -60.0), (60.0, 60.0), (-60.0, 60.0)))
TWO_ANTENNAS = Sensors(heading_deviation=0.01)
LIDAR = Sensors(lidar_rays=9, lidar_field=math.pi)


def cases() -> Iterator[Case]:
    """Yield all that may fail."""
    yield from _lost_places()
    yield from _false_places()
    yield from _motions()
    yield from _motions_of_a_stand()
    yield from _eyes()
    yield from _programs()


def _unplaced(name: str, what: str, change: Change, shows: str, cause: Cause = Cause.NONE) -> Case:
    """Return a fault after which a kart does not know better where it is than by its way."""
    return Case(Fault(name, what, change), Then.GOES_ON, shows, cause, KART_M)


def _lost_places() -> Iterator[Case]:
    what = "no position fix comes any more"
    yield _unplaced("fixes-stop", what, _set(fix=None), "fixes silent")
    what = "the receiver repeats one place"
    yield _unplaced("fixes-freeze", what, _fix(_same_place), "fixes stuck")
    what = "the receiver tells NaN for a place"
    change = _fix(lambda fix, _: replace(fix, x=NAN))
    yield _unplaced("fixes-no-number", what, change, "fixes silent")
    what = "fixes without a stamp come 0.4 s later than before"
    yield _unplaced("fixes-late", what, _late, "fixes refused", Cause.LOST)
    lost = Fault("beacons-stop", "fixes and ranges stop together", _lost, sensors=BEACONS)
    yield Case(lost, Then.GOES_ON, "beacons silent", off_m=KART_M)
    what = "fixes stop, and one of four beacons tells 5 m too much"
    far = Fault("beacon-far", what, _far, sensors=BEACONS)
    yield Case(far, Then.GOES_ON, "fixes silent")


def _false_places() -> Iterator[Case]:
    what = "three of ten fixes lie 2 to 20 m beside"
    yield Case(Fault("fixes-reflected", what, _fix(_reflected)), Then.GOES_ON)
    shifted = _fix(lambda fix, _: replace(fix, y=fix.y + 2.0))
    fault = Fault("map-shifted", "all fixes lie 2 m north of where they were", shifted)
    yield Case(fault, Then.GOES_ON, "fixes refused", Cause.LOST, off_m=2.5)
    for name, by_s in (("ahead", 1.0), ("back", -1.0)):
        what = f"the receiver's clock jumps 1 s {name}"
        yield Case(Fault(f"stamps-{name}", what, _fix(_stamped(by_s))), Then.GOES_ON)
    turned = _fix(lambda fix, _: replace(fix, heading=(fix.heading or 0.0) + 0.5 * math.pi))
    what = "two antennas tell a heading that is 90° wrong"
    yield Case(Fault("heading-turned", what, turned, sensors=TWO_ANTENNAS), Then.GOES_ON)


def _lame(fault: Fault, shows: str, shows_s: float = SHOWS_S) -> Case:
    """Return a fault after which a kart does not know how it moves."""
    return Case(fault, Then.CRAWLS, shows, Cause.SENSOR, KART_M, shows_s)


def _motions() -> Iterator[Case]:
    for name, field in (("wheels", "wheel_speed"), ("gyro", "yaw_rate"), ("steering", "steering")):
        silent = Fault(f"{name}-stop", f"nothing comes from the {name}", _set(**{field: NAN}))
        yield _lame(silent, f"{name} silent")
        hangs = Fault(f"{name}-hang", f"the {name} repeats one number", _hangs(field))
        # An angle may be right for a while, until another one is asked for.
        yield _lame(hangs, f"{name} stuck", 3.0 if name == "steering" else SHOWS_S)
    endless = Fault(
        "wheels-endless", "the wheels tell an endless speed", _set(wheel_speed=math.inf)
    )
    yield _lame(endless, "wheels silent")
    stand = Fault("wheels-stand", "the wheels tell a stand", _set(wheel_speed=0.0))
    yield _lame(stand, "wheels stuck")
    silent = Fault(
        "accelerometer-stop", "nothing comes from the accelerometer", _set(acceleration=None)
    )
    yield _lame(silent, "accelerometer silent")
    what = "the accelerometer repeats one number"
    yield _lame(Fault("accelerometer-hang", what, _hangs("acceleration")), "accelerometer stuck")
    locks = Fault(
        "wheels-lock",
        "the wheels lock at a quarter of the brakes, and the driver brakes",
        control=lambda control: replace(control, throttle=0.0, brake=0.6),
        sensors=Sensors(wheels_lock=0.25),
    )
    yield Case(locks, Then.HALTS)
    off = Fault(
        "gyro-off",
        "the gyro tells 0.2 rad/s too much",
        lambda readings, _: replace(readings, yaw_rate=readings.yaw_rate + 0.2),
    )
    yield Case(off, Then.GOES_ON, "gyro refused")


def _motions_of_a_stand() -> Iterator[Case]:
    """Yield faults of a kart that stands, and drives off afterwards."""
    for name, field in (("wheels", "wheel_speed"), ("gyro", "yaw_rate")):
        what = f"nothing comes from the {name} of a kart that stands and then drives off"
        silent = Fault(f"{name}-stop-standing", what, _set(**{field: NAN}), standing=True)
        yield _lame(silent, f"{name} silent")
        what = f"the {name} of a kart that stands and then drives off repeats one number"
        hangs = Fault(f"{name}-hang-standing", what, _hangs(field), standing=True)
        case = _lame(hangs, f"{name} stuck", HANGS_S)
        yield replace(case, off_m=PINNED_M) if name == "wheels" else case


def _eyes() -> Iterator[Case]:
    def blind(name: str, what: str, change: Change, shows: str) -> Case:
        return Case(Fault(f"radar-{name}", what, change), Then.STOPS, shows, Cause.SENSOR)

    yield blind("stop", "no scan of the radar comes any more", _set(echoes=None), "radar silent")
    yield blind("hang", "the radar repeats one scan", _hangs("echoes"), "radar stuck")
    yield blind("no-number", "the radar tells NaN for all places", _spoilt, "radar silent")
    silent = Fault(
        "lidar-stop", "no scan of the lidar comes any more", _set(ranges=None), sensors=LIDAR
    )
    yield Case(silent, Then.GOES_ON, "lidar silent")


def _programs() -> Iterator[Case]:
    ahead = Fault("clock-ahead", "the kart's clock jumps 1 s ahead", clock_s=1.0)
    # By the way of that second, until the next fix.
    yield Case(ahead, Then.GOES_ON, cause=Cause.LOST, off_m=20.0)
    back = Fault("clock-back", "the kart's clock jumps 1 s back", clock_s=-1.0)
    yield Case(back, Then.GOES_ON)
    hangs = Fault("game-hangs", "nothing new comes from the game's side", silent=True)
    yield Case(hangs, Then.HALTS, cause=Cause.GAME)
    what = "one of ten words of the game's side is damaged"
    yield Case(Fault("words-damaged", what, damaged_every=10), Then.GOES_ON)
    steers = Fault(
        "driver-no-number",
        "the driver's steering is NaN",
        control=lambda control: replace(control, steering=NAN),
    )
    yield Case(steers, Then.HALTS, cause=Cause.DRIVER)
    capped = Fault(
        "orders-no-number",
        "the server's speed cap is NaN",
        orders=lambda orders: replace(orders, speed_cap=NAN),
    )
    yield Case(capped, Then.HALTS, cause=Cause.LINK)
    silent = Fault("radio-off", "nothing comes from the server", orders=lambda _: None)
    yield Case(silent, Then.HALTS, cause=Cause.LINK)
    both = Fault(
        "both-pedals",
        "the driver holds throttle and brake down",
        control=lambda control: replace(control, throttle=1.0, brake=1.0),
    )
    yield Case(both, Then.STOPS)
