"""A real kart's control unit, without I/O: sensors and messages in, actuators and reports out.

It has two sides. One applies the game: speed cap, share of the motor. The other keeps the kart safe
with the kart's sensors. `decide` takes the strictest of both, so a message can lower the speed but
never raise it.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.danger import NO_DANGER, nearest_of, severity_of, watch_danger, worst_ahead
from race_agents.unit.drift import STRAIGHT_ON, Arcs, Drift
from race_agents.unit.ego import EgoMotion
from race_agents.unit.estimator import Estimator
from race_agents.unit.fence import Fence
from race_agents.unit.limits import Limits
from race_agents.unit.motion import HEADING, SLIDE, SPEED, YAW_RATE, X, Y, pose_of
from race_agents.unit.objects import Objects
from race_agents.unit.orders import Orders
from race_agents.unit.peers import PeerWatch, Whereabouts
from race_agents.unit.readings import MICROSECONDS, Fix, Readings
from race_agents.unit.safety import (
    STOP_FOR_OBSTACLE,
    Command,
    Echoes,
    Verdict,
    combine,
    watch_creeping,
    watch_driver,
    watch_fence,
    watch_game,
    watch_link,
    watch_obstacles,
    watch_place,
    watch_restart,
    watch_sensors,
    watch_speed,
)
from race_agents.unit.sensor_watch import FAILED, SensorWatch
from race_agents.unit.timeline import LIKE_STEPS
from race_server.core import codes
from race_server.core.alert import Advice, Alert, Cause, Danger, DangerStage
from race_server.core.messages import Button, Control, Flag, Pose, Source, Trust
from race_server.core.peer import Peer
from race_server.core.telemetry import Health, Sensor, SensorState
from race_server.core.vehicles import Vehicle

# Without a position fix for longer than this [s] the place is dead reckoning.
FIX_S = 0.5

STOP = Control(brake=1.0)
STANDS = 0.05  # [m/s]
# Faster than this [m/s] the gyro tells the bend that is driven.
ROLLS = 2.0
# A person last seen this long ago [s] may still be there: beside a front corner no beam reaches.
UNSEEN_S = 3.0
# What may be people: not every radar tells one from a thing.
PEOPLE = (codes.OBSTACLE, codes.PERSON)


@dataclass
class ControlUnit:
    """Fuses, obeys, and holds the reflex."""

    vehicle: Vehicle
    fence: Fence
    limits: Limits
    watch: SensorWatch
    objects: Objects
    fusion: Estimator | None = None  # from the first position fix on
    hud: Orders | None = None
    command: Command = field(default_factory=Command)
    steering: float = 0.0
    battery: float | None = None  # [0, 1] of its charge
    echoes: Echoes = field(default_factory=Echoes.nothing)  # those that others confirm
    loose: Echoes = field(default_factory=Echoes.nothing)  # … but those of karts that are known
    danger: Danger = NO_DANGER
    others: PeerWatch = field(default_factory=PeerWatch)
    _ego: EgoMotion = field(default_factory=EgoMotion)
    ranges: NDArray[np.float64] | None = None  # [m] of the lidar over the centre of gravity
    _hud_s: float = -math.inf
    _game_s: float | None = None  # when the program beside was last heard; None: there is none
    _driver: Control = STOP
    _driver_s: float = -math.inf
    _time_s: float = 0.0
    _fix_s: float = -math.inf
    _source: Source = Source.UNKNOWN
    _is_busy: bool = False  # in this turn is a scan, or much of the past was driven again
    _is_braking: bool = False  # the reflex began to brake for something and is not through
    _met: Danger = NO_DANGER  # what it braked fully for last
    _met_s: float = -math.inf  # when a person was last seen in the way, or near

    @classmethod
    def of(cls, vehicle: Vehicle, fence: Fence) -> "ControlUnit":
        """Return the unit of a kart of this kind."""
        limits = Limits.of(vehicle)
        return cls(vehicle, fence, limits, SensorWatch(vehicle), Objects(limits.nose))

    def hear(self, hud: Orders, now_s: float) -> None:
        """Take what the game wants of this kart; what is no number is not heard."""
        if not any(math.isnan(each) for each in (hud.speed_cap, hud.thrust_scale, hud.valid_s)):
            self.hud, self._hud_s = hud, now_s

    def hear_game(self, now_s: float) -> None:
        """Note that the program which brings orders and driver is alive: it has to go on."""
        self._game_s = now_s

    def hear_peers(self, peers: tuple[Peer, ...]) -> None:
        """Take what other real karts tell, each the newest; their stamps are of this clock."""
        self.others.peers = peers

    def drive(self, control: Control, now_s: float) -> None:
        """Take what the driver wants; what is no number is not heard."""
        if all(map(math.isfinite, (control.steering, control.throttle, control.brake))):
            self._driver, self._driver_s = control, now_s

    def sense(self, readings: Readings) -> None:
        """Take the newest readings."""
        dt = max(readings.time_s - self._time_s, 0.0)
        self._time_s = readings.time_s
        self._forget_later_than(readings.time_s)
        speed = 0.0 if self.fusion is None else float(self.fusion.state[SPEED])
        asked = self.command.steering * self.vehicle.steering_limit
        readings = self.watch.take(readings, speed, asked)
        self.battery = readings.battery
        self.steering = asked if math.isnan(readings.steering) else readings.steering
        if readings.ranges is not None or self.watch.state(Sensor.LIDAR) in FAILED:
            self.ranges = readings.ranges
        if self.fusion is None:
            self._begin(readings.fix)
            return
        taken = self.fusion.sense(readings, self.watch.seen.surely(self._time_s))
        self._is_busy = readings.echoes is not None or self.fusion.timeline.work > LIKE_STEPS
        self.watch.judge(Sensor.WHEELS, is_believed=not self.fusion.wheels.is_lost)
        self.watch.judge(Sensor.GYRO, is_believed=not self.fusion.is_gyro_off)
        if readings.beacons and self.fusion.is_ranged:
            self._fix_s, self._source = readings.time_s, Source.BEACONS
        for fix, is_believed in taken:
            self.watch.judge(Sensor.FIXES, is_believed=is_believed)
            if is_believed:
                self._fix_s, self._source = readings.time_s, fix.source
        self._look(readings.echoes, dt)

    def _forget_later_than(self, now_s: float) -> None:
        """Take it that nothing was heard later than now: the clock may have been set back."""
        self._driver_s, self._hud_s = min(self._driver_s, now_s), min(self._hud_s, now_s)
        self._fix_s, self._met_s = min(self._fix_s, now_s), min(self._met_s, now_s)
        self._game_s = None if self._game_s is None else min(self._game_s, now_s)

    def _look(self, echoes: Echoes | None, dt: float) -> None:
        """Take what the radar sees, if there is something new."""
        assert self.fusion is not None
        speed, turn, slide = (float(self.fusion.state[at]) for at in (SPEED, YAW_RATE, SLIDE))
        self._ego.advance(speed, slide, turn, dt)
        if echoes is None:
            return
        seconds = self._ego.seconds
        aside = slide + self.limits.nose * turn
        self.objects.look(echoes, self._ego.take(speed, aside), seconds)
        self.echoes, self.loose = self.objects.seen, self.objects.loose

    def _begin(self, fix: Fix | None) -> None:
        """Begin at the first fix: facing as two antennas say or, with one, along the course.

        So every kart does on a grid. In a car park the fix has to tell the heading: until one does,
        the kart does not move.
        """
        if fix is None:
            return
        heading = self.fence.heading_at(fix.x, fix.y) if fix.heading is None else fix.heading
        if heading is not None:
            self.fusion = Estimator(
                self.vehicle, fix, heading, self._time_s, borders=self.fence.borders
            )
            self._fix_s, self._source = self._time_s, fix.source

    def decide(self, now_s: float) -> Command:
        """Return what goes to the actuators now."""
        self._forget_later_than(now_s)
        if self.fusion is None or self.hud is None:
            self.command = Command()
            return self.command
        if not math.isfinite(self.fusion.state.sum()):  # it does not know where it is
            self.command = Command(cause=Cause.SENSOR)
            return self.command
        speed = float(self.fusion.state[SPEED])
        self.command = combine(
            self._driver,
            speed,
            self._verdicts(now_s, speed),
            self.limits,
            game_speed=self.hud.speed_cap,
            thrust=self.hud.thrust_scale,
        )
        self._is_busy = False
        return self.command

    def _verdicts(self, now_s: float, speed: float) -> list[Verdict]:
        assert self.fusion is not None
        assert self.hud is not None
        wanted = self._driver.steering * self.vehicle.steering_limit
        now, will = (math.tan(angle) / self.vehicle.wheelbase for angle in (self.steering, wanted))
        if speed > ROLLS:  # tyres that slip take a wider way than the wheels point to
            now = self._ego.yaw_rate / speed
        x, y = (float(value) for value in self.fusion.state[[X, Y]])
        asked = self._driver.brake * self.limits.promised
        arcs = Arcs(speed, now, will, self._drift(speed), min(asked, self.fusion.slowing))
        ahead, sensed = self._watch_ahead(arcs), self.danger
        told = self._danger_of_peers(arcs, now_s)
        self.danger = max(sensed, told, key=severity_of)
        return [
            ahead,
            watch_danger(sensed),
            watch_danger(told),
            watch_driver(now_s - self._driver_s, self.limits),
            watch_link(now_s - self._hud_s, self.hud.valid_s, self.limits),
            watch_game(now_s - (now_s if self._game_s is None else self._game_s), self.limits),
            watch_speed(speed, self.limits),
            watch_fence(self.fence.beyond(x, y), self.limits),
            watch_place(
                self.fusion.deviation,
                self.limits,
                is_doubtful=self.watch.state(Sensor.FIXES) is SensorState.REFUSED,
            ),
            watch_sensors(self.limits, is_blind=self.watch.is_blind, is_lame=self.watch.is_lame),
        ]

    def _watch_ahead(self, arcs: Arcs) -> Verdict:
        """Brake for what stands ahead until the kart stands, and then until the way is free.

        A driver that releases the pedal, or backs away, may try again. For another kart, which
        drives on, the brakes are on only while it is in danger, or right before this one.
        """
        speed, ways = arcs.speed, (arcs.speed, arcs.now, arcs.wanted, self.limits)
        danger = self.danger = worst_ahead(self.objects.tracks, self.loose, arcs, self.limits)
        if self._driver.throttle < 0.0 and speed < STANDS:
            self._is_braking = False
            return Verdict()
        still = self.echoes.without_karts()
        if danger.stage is DangerStage.FULL:
            alone = watch_obstacles(still, *ways).brake > 0.0
            self._is_braking |= alone or danger.kind in PEOPLE
            people = watch_obstacles(self.echoes.of_people(), *ways)
            if people.brake > 0.0 or danger.kind in PEOPLE:
                self._met_s = self._time_s
            self._met = danger
            return STOP_FOR_OBSTACLE
        if self._is_braking and speed > STANDS:
            self.danger = self._met
            return STOP_FOR_OBSTACLE
        if self._driver.throttle <= 0.0:
            self._is_braking = False
            return Verdict()
        held = Verdict()
        if self._is_braking:
            held = self._hold(watch_restart(still, self.limits))
            self._is_braking = held.brake > 0.0
        near = watch_creeping(self.echoes, arcs.wanted, self.limits.stand_off, self.limits)
        verdict = held if held.brake > 0.0 else near
        if verdict.brake > 0.0:
            self.danger = self._what_is_waited_for()
        return verdict

    def _danger_of_peers(self, arcs: Arcs, now_s: float) -> Danger:
        """Return the worst of what other karts tell."""
        assert self.fusion is not None
        x, y, heading = (float(self.fusion.state[at]) for at in (X, Y, HEADING))
        own = Whereabouts(x, y, heading, self.fusion.deviation, self._heading_deviation, now_s)
        return self.others.look(own, self.fence, self.limits, arcs, is_busy=self._is_busy)

    @property
    def _heading_deviation(self) -> float:
        """Deviation of the heading [rad], 0 before the first fix."""
        if self.fusion is None:
            return 0.0
        return math.sqrt(float(self.fusion.filter.covariance[HEADING, HEADING]))

    def _drift(self, speed: float) -> Drift:
        if self.fusion is None or speed < ROLLS:
            return STRAIGHT_ON
        slide, yaw_rate = (float(self.fusion.state[at]) for at in (SLIDE, YAW_RATE))
        return Drift.of(speed, slide, yaw_rate, self.limits)

    def _what_is_waited_for(self) -> Danger:
        """Return what a kart that stands waits for: the nearest thing, or what it braked for."""
        things = self.echoes.without_borders()
        if len(things.x):
            return nearest_of(things, self.limits, Advice.WAIT)
        return replace(self._met, advice=Advice.WAIT)

    def _hold(self, held: Verdict) -> Verdict:
        """Hold a kart for a while after the last person in front was seen."""
        if held.brake > 0.0:
            self._met_s = self._time_s
        return STOP_FOR_OBSTACLE if self._time_s - self._met_s < UNSEEN_S else Verdict()

    def alert(self) -> Alert:
        """Return what the kart has to say: what it sees ahead, and what it does by itself."""
        cause, stage = self.command.cause, self.danger.stage
        if cause:
            stage = max(stage, DangerStage.EASE)
        return Alert(round(self._time_s * MICROSECONDS), replace(self.danger, stage=stage), cause)

    def pose(self) -> Pose | None:
        """Return the pose of the kart's centre of gravity, as it is sent to the server."""
        if self.fusion is None:
            return None
        lost_s = self._time_s - self._fix_s
        source = self._source if lost_s < FIX_S else Source.DEAD_RECKONING
        pose = pose_of(self.fusion.state, self.vehicle, stands=STANDS)
        return replace(
            pose,
            stamp_us=round(self._time_s * MICROSECONDS),
            steering=self.steering,
            deviation=self.fusion.deviation,
            # Halved for every two seconds of dead reckoning.
            quality=1.0 if lost_s < FIX_S else 0.5 ** (0.5 * (lost_s - FIX_S)),
            source=source,
        )

    def health(self) -> Health:
        """Return what neither pose nor alert tells of the kart."""
        spread = self._heading_deviation
        link_s = None if self.hud is None else max(self._time_s - self._hud_s, 0.0)
        return Health(self.watch.states(), spread, link_s, self.battery)

    @property
    def braking(self) -> float:
        """Braking that is asked of the brakes [m/s²], as they do as a rule."""
        return self.command.brake * self.limits.promised

    @property
    def is_home(self) -> bool:
        """Whether the kart was ordered to stop after the start, and stands."""
        hud = self.hud
        if hud is None or hud.trust is Trust.SUSPENDED or hud.flag is Flag.RED:
            return False
        told = hud.lights_s == 0.0 and hud.speed_cap == 0.0
        return told and self.fusion is not None and abs(self.fusion.state[SPEED]) < STANDS

    @property
    def buttons(self) -> Button:
        """What the driver presses."""
        return self._driver.buttons & Button.USE_ITEM
