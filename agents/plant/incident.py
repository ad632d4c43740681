"""Incidents made on purpose while the plant races: a person steps in front, the radio fails.

Each is measured, so that a drill can show how the control unit reacted.
"""

import math
import os
import signal
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from race_agents.onboard.safety_side import SafetySide
from race_agents.plant.body import Body
from race_agents.plant.kart import Plant
from race_agents.plant.radar import Floats, Person, gap_to
from race_agents.unit.control_unit import ControlUnit
from race_server.core.alert import Cause, DangerStage

STANDS = 0.03  # [m/s] slower than this is standing
# The person is on the way where this share of the way that the kart needs to stop is left, and
# walks there from this many kart widths beside it, for this long [s].
ROOM, ASIDE_WIDTHS, WALK_S = 1.3, 1.3, 1.2
STAY_S = 2.0  # a person stays this long once the kart stands
WATCH_S = 3.0  # a kart without radio is watched this long once it stands
# A kart that is ordered to slow down has a second to react, then brakes with this at least [m/s²].
BRAKES_AT = 2.0
# [rad] that the way to the person may turn, and by which the course may turn otherwise there.
MOST_BEND, MOST_STRAY = 0.3, 0.12
# A turn that takes longer [s] shows that the machine had no time for the kart's program.
PAUSE_S = 0.3
MOST_ALERTS = 200
VIEW_WIDTHS = 2.0  # kart widths beside the way in which no other kart may be
RETRY_S = 3.0  # after a kart drove past a person beside its way
# It happens to a kart that is fast: this share of its top speed or, where no course allows that, of
# the fastest that it has been.
FAST, NEARLY_FASTEST = 0.45, 0.75


@dataclass
class FastestSpeed:
    """Whether a kart is fast, as far as this course allows."""

    fastest: float = 0.0  # [m/s] so far

    def is_fast(self, body: Body) -> bool:
        """Record the body's speed and return whether it is high."""
        self.fastest = max(self.fastest, body.speed)
        return body.speed > min(FAST * body.vehicle.top_speed, NEARLY_FASTEST * self.fastest)


@dataclass
class PersonIncident:
    """A person who walks onto the track and stands there, and how the kart met it."""

    after_s: float  # of racing
    person: Person | None = None
    figures: dict[str, Any] = field(default_factory=dict)
    is_over: bool = False
    _fastest: FastestSpeed = field(default_factory=FastestSpeed)
    _stood_s: float = math.inf
    _walked_s: float = 0.0  # until this time of racing

    def turn(self, plant: Plant, unit: ControlUnit, raced_s: float) -> None:
        """Step out, be met, walk away."""
        is_fast = self._fastest.is_fast(plant.body)
        if self.is_over or raced_s < self.after_s:
            return
        if self.person is None:
            if is_fast:
                self._step_out(plant, unit, raced_s)
            return
        self._walk(raced_s)
        body, figures = plant.body, self.figures
        figures["least_gap_m"] = min(figures["least_gap_m"], gap_to(self.person, body))
        if unit.command.cause & Cause.OBSTACLE and "braked_after_s" not in figures:
            figures["braked_after_s"] = raced_s - figures["at_s"]
        if self._stood_s == math.inf and _is_past(self.person, plant):
            self._walk_away(plant)
            self.person, self.after_s = None, raced_s + RETRY_S
            return
        if abs(body.speed) > STANDS:
            return
        if self._stood_s == math.inf:
            self._stood_s = raced_s
            figures["stood_after_s"] = raced_s - figures["at_s"]
            figures["throttle_when_standing"] = plant.throttle
            figures["motor_when_standing"] = unit.command.throttle
        if raced_s - self._stood_s > STAY_S:
            figures["gap_left_m"] = gap_to(self.person, body)
            self._walk_away(plant)
            self.is_over = True

    def _walk(self, raced_s: float) -> None:
        """Walk on to the kart's way, and stand there."""
        assert self.person is not None
        person, arrives_s = self.person, self.figures["at_s"] + WALK_S
        seconds = min(raced_s, arrives_s) - self._walked_s
        self._walked_s = raced_s
        person.x, person.y = person.x + person.vx * seconds, person.y + person.vy * seconds
        if raced_s >= arrives_s:
            person.vx = person.vy = 0.0

    def _walk_away(self, plant: Plant) -> None:
        plant.around.people.clear()
        plant.throttle = None

    def _step_out(self, plant: Plant, unit: ControlUnit, raced_s: float) -> None:
        """Step out on the way of the kart, where it need not turn much before."""
        body, limits = plant.body, unit.limits
        way = body.speed * limits.reaction_s + body.speed**2 / (2.0 * limits.braking)
        radius = 0.15 * body.vehicle.length
        ahead = limits.nose - body.vehicle.rear_axle + ROOM * way + limits.stand_off + radius
        ahead += body.speed * WALK_S
        curvature = math.tan(body.steering) / body.vehicle.wheelbase
        middle = body.heading + 0.5 * curvature * ahead
        x, y = body.x + ahead * math.cos(middle), body.y + ahead * math.sin(middle)
        turned = curvature * ahead
        course = unit.fence.heading_at(x, y)
        course = body.heading + turned if course is None else course  # a car park has none
        stray = math.remainder(course - body.heading - turned, 2.0 * math.pi)
        if abs(stray) > MOST_STRAY or abs(turned) > MOST_BEND:
            return
        if not is_view_clear(Person(x, y, radius), body, plant.around.others):
            return
        aside = ASIDE_WIDTHS * body.vehicle.width  # to the right of the way
        right = body.heading + turned - 0.5 * math.pi
        cos, sin = math.cos(right), math.sin(right)
        pace = aside / WALK_S
        person = Person(x + aside * cos, y + aside * sin, radius, -pace * cos, -pace * sin)
        self.person, self._walked_s = person, raced_s
        plant.around.people.append(self.person)
        plant.throttle = 1.0
        self.figures = {
            "at_s": raced_s,
            "speed": body.speed,
            "driver_throttle": plant.throttle,
            "gap_m": gap_to(self.person, body),
            "least_gap_m": math.inf,
        }


def is_view_clear(person: Person, body: Body, others: Floats) -> bool:
    """Return whether no other kart is, or soon comes, between a kart and a person on its way.

    A person who steps out behind a kart is seen once that kart has gone, which no reflex can help.
    others: (N, 5) x, y [m] and more of each.
    """
    cos, sin = math.cos(body.heading), math.sin(body.heading)
    dx, dy = others[:, 0] - body.x, others[:, 1] - body.y
    ahead, aside = dx * cos + dy * sin, np.abs(dy * cos - dx * sin)
    length, far = body.vehicle.length, math.hypot(person.x - body.x, person.y - body.y)
    between = (ahead > -length) & (ahead < far + length)
    return not bool((between & (aside < VIEW_WIDTHS * body.vehicle.width)).any())


def _is_past(person: Person, plant: Plant) -> bool:
    """Return whether a kart has driven past a person without touching."""
    body = plant.body
    dx, dy = person.x - body.x, person.y - body.y
    ahead = dx * math.cos(body.heading) + dy * math.sin(body.heading)
    return ahead < 0.0 and gap_to(person, body) > 0.0


@dataclass
class RadioLoss:
    """The radio fails and stays off."""

    after_s: float  # of racing
    figures: dict[str, Any] = field(default_factory=dict)
    is_over: bool = False
    _fastest: FastestSpeed = field(default_factory=FastestSpeed)
    _from: tuple[float, float] = (0.0, 0.0)
    _stood_s: float = math.inf

    def turn(self, plant: Plant, side: SafetySide, raced_s: float) -> None:
        """Switch off, and measure how the kart comes to a stop with the foot down."""
        body = plant.body
        if not side.is_cut:
            if not self._fastest.is_fast(body) or raced_s < self.after_s:
                return
            side.is_cut = True
            plant.throttle = 1.0
            self._from = body.x, body.y
            self.figures = {"at_s": raced_s, "speed": body.speed, "driver_throttle": 1.0}
            return
        if abs(body.speed) > STANDS:
            self._stood_s = math.inf
            return
        if self._stood_s == math.inf:
            self._stood_s = raced_s
            self.figures["stood_after_s"] = raced_s - self.figures["at_s"]
            straight = math.hypot(body.x - self._from[0], body.y - self._from[1])
            self.figures["stopped_within_m"] = straight
            self.figures["cause"] = [flag.name for flag in Cause if flag & side.unit.command.cause]
        self.is_over = raced_s - self._stood_s > WATCH_S


@dataclass
class GameLoss:
    """The process of the game's side is killed, as by kill -9, once the kart is this fast."""

    speed: float  # [m/s]
    figures: dict[str, Any] = field(default_factory=dict)
    _from: tuple[float, float] = (0.0, 0.0)

    def turn(self, plant: Plant, side: SafetySide, now_s: float) -> bool:
        """Kill it, and measure how the kart comes to a stop; False once it stands."""
        body, figures = plant.body, self.figures
        if not figures:
            if body.speed >= self.speed and side.unit.command.cause is Cause.NONE:
                os.kill(os.getppid(), signal.SIGKILL)
                self._from = body.x, body.y
                self.figures = {"at_s": now_s, "speed": body.speed}
            return True
        for name, has_begun in (
            ("motor_off_after_s", side.unit.command.throttle <= 0.0),
            ("braked_after_s", side.unit.command.brake > 0.0),
            ("stood_after_s", abs(body.speed) < STANDS),
        ):
            if has_begun and name not in figures:
                figures[name] = now_s - figures["at_s"]
        if "stood_after_s" not in figures:
            return True
        figures["stopped_within_m"] = math.hypot(body.x - self._from[0], body.y - self._from[1])
        figures["cause"] = [flag.name for flag in Cause if flag & side.unit.command.cause]
        return False


@dataclass
class IncidentLog:
    """Runs the incidents and keeps the figures of one race."""

    plant: Plant
    person: PersonIncident | None = None
    radio_loss: RadioLoss | None = None
    game_loss: GameLoss | None = None
    figures: dict[str, Any] = field(default_factory=dict)
    alerts: list[dict[str, Any]] = field(default_factory=list)  # what the kart warned of, and did
    _stage: DangerStage = DangerStage.NONE
    _green_s: float = math.inf
    _orders: list[list[float]] = field(default_factory=list)  # cap, since, worst excess
    _cap: float = math.inf
    _slow_s: float = math.inf  # from then on the kart should be as slow as ordered
    _errors: list[float] = field(default_factory=list)
    _turned_s: float = math.inf
    _longest_turn_s: float = 0.0
    _pauses: int = 0

    def turn(self, side: SafetySide, now_s: float) -> bool:
        """Note one decision; False once this kart has nothing more to do."""
        unit = side.unit
        self._longest_turn_s = max(self._longest_turn_s, now_s - self._turned_s)
        self._pauses += now_s - self._turned_s > PAUSE_S
        self._turned_s = now_s
        hud = unit.hud
        if hud is None:
            return True
        if hud.lights_s == 0.0 and hud.tick > 0 and self._green_s == math.inf:
            self._green_s = now_s
        raced_s = now_s - self._green_s
        self._note_place(unit)
        self._note_danger(unit, raced_s)
        self._note_orders(unit, now_s)
        if self.person is not None and raced_s > 0.0:
            self.person.turn(self.plant, unit, raced_s)
        if self.radio_loss is not None and raced_s > 0.0:
            self.radio_loss.turn(self.plant, side, raced_s)
            if side.is_cut:
                return not self.radio_loss.is_over
        if self.game_loss is not None and raced_s > 0.0:
            return self.game_loss.turn(self.plant, side, now_s)
        return raced_s < 1.0 or not unit.is_home

    def _note_place(self, unit: ControlUnit) -> None:
        if (pose := unit.pose()) is not None:
            body = self.plant.body
            self._errors.append(math.hypot(pose.x - body.x, pose.y - body.y))

    def _note_danger(self, unit: ControlUnit, raced_s: float) -> None:
        """Note what the kart saw, each time that a danger comes a stage further."""
        danger, before = unit.danger, self._stage
        self._stage = danger.stage
        if (
            danger.stage < DangerStage.WARN
            or danger.stage <= before
            or len(self.alerts) >= MOST_ALERTS
        ):
            return
        self.alerts.append(
            {
                "at_s": round(raced_s, 2),
                "stage": danger.stage.name.lower(),
                "kind": danger.kind.name.lower(),
                "bearing_deg": round(math.degrees(danger.bearing), 1),
                "distance_m": round(danger.distance, 2),
                "time_s": round(danger.time_s, 2),
                "needed": round(danger.needed, 2),
                "advice": danger.advice.name.lower(),
            }
        )

    def _note_orders(self, unit: ControlUnit, now_s: float) -> None:
        """Note each time the game slows this kart, and whether the kart obeys in time."""
        assert unit.hud is not None
        cap, speed = unit.hud.speed_cap, abs(self.plant.body.speed)
        slowed = cap < 0.99 * unit.vehicle.top_speed
        if slowed and (self._cap != cap):
            self._orders.append([cap, now_s, 0.0])
            self._slow_s = now_s + 1.0 + max(speed - cap, 0.0) / BRAKES_AT
        self._cap = cap
        if slowed and now_s > self._slow_s:
            self._orders[-1][2] = max(self._orders[-1][2], speed - cap)

    def summary(self) -> dict[str, Any]:
        """Return the figures of the race."""
        errors = sorted(self._errors) or [math.nan]
        kept = [order for order in self._orders if math.isfinite(order[0])]
        return {
            "pose_error_median_m": errors[len(errors) // 2],
            "pose_error_p99_m": errors[int(0.99 * (len(errors) - 1))],
            "slowdowns": len(kept),
            "worst_excess_share": max(
                (order[2] / max(order[0], 1.0) for order in kept), default=0.0
            ),
            "worst_excess": max((order[2] for order in kept), default=0.0),
            "scrapes": self.plant.scrapes,
            "pauses": self._pauses,
            "longest_turn_s": self._longest_turn_s,
            "alerts": self.alerts,
            "pedestrian": self.person.figures if self.person else None,
            "cut": self.radio_loss.figures if self.radio_loss else None,
            "game_loss": self.game_loss.figures if self.game_loss else None,
            **self.figures,
        }
