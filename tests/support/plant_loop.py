"""A plant with its control unit in a session, turn by turn, without a network."""

import math

from race_agents.plant.kart import Plant
from race_agents.plant.radar import Surroundings
from race_agents.plant.sensors import Sensors
from race_agents.unit.control_unit import ControlUnit
from race_agents.unit.fence import CourseFence
from race_server.core.messages import Control, Event
from race_server.core.observation import Observation
from race_server.core.vehicle_presets import KART_30, TT02
from race_server.live.server.hud import hud_of
from race_server.scenario.race import Rules, Scenario
from race_server.session.session import Session
from support.courses import ring


class Loop:
    """A session, a plant and its control unit on one clock; the driver keeps to the middle."""

    def __init__(self, scale: str = "1/10", **sensors: float) -> None:
        vehicle, size = (TT02, 1.0) if scale == "1/10" else (KART_30, 5.0)
        course = ring(radius=4.0 * size, half_width=0.8 * size)
        rules = Rules(laps=2, countdown_s=0.5)
        self.session = Session("test", Scenario(course, karts=2, vehicles=(vehicle,), rules=rules))
        self.session.join("real", "track", tracked=True)
        self.session.join("other", "track")
        self.session.start()
        self.around = Surroundings(course.borders)
        place = tuple(float(value) for value in course.grid[0])
        self.plant = Plant.of(vehicle, self.around, place, Sensors(**sensors), seed=5)
        fence = CourseFence.of(course.line, course.half_widths, course.kerb, course.borders)
        self.unit = ControlUnit.of(vehicle, fence)
        self.vehicle, self.sequence, self.pace, self.foot_down = vehicle, 0, 2.0 * size**0.7, False
        self.events: list[Event] = []
        self.hears = True

    def run(self, seconds: float) -> "Loop":
        for _ in range(round(seconds * 60)):
            tick = self.session.tick
            now_s = tick / 60.0
            self.unit.sense(self.plant.read(now_s + 77.0))  # a separate clock
            if self.hears and tick % 3 == 0:
                self.session.observe()
                self.unit.hear(hud_of(self.session, self.session.seats[0]), now_s + 77.0)
                values = self.session.view(0).copy()
                self.control = self._steer(Observation(tick, self.session.layout("track"), values))
            self.unit.drive(self.control, now_s + 77.0)
            self.plant.act(self.unit.decide(now_s + 77.0))
            self._tell(round(now_s * 1e6))
            self.session.follow(round(now_s * 1e6))
            self.events += self.session.advance(1)
        return self

    def _steer(self, seen: Observation) -> Control:
        bend = math.atan(self.vehicle.wheelbase * seen["curvature_ahead"][0])
        size = self.vehicle.length
        turn = -0.5 * seen.scalar("lateral_offset") / size - seen.scalar("heading_error")
        share = (bend + 0.5 * turn) / self.vehicle.steering_limit
        throttle = max(-1.0, min(2.0 * (self.pace - seen.scalar("speed")), 1.0))
        if seen.scalar("lights") > 0.0:
            throttle = 0.0
        throttle = 1.0 if self.foot_down else max(throttle, 0.0)
        return Control(max(-1.0, min(share, 1.0)), throttle)

    def _tell(self, now_us: int) -> None:
        pose, hud = self.unit.pose(), self.unit.hud
        if pose is None or hud is None or not self.hears:
            return
        self.sequence += 1
        self.session.receive_pose(
            0, 1, self.sequence, pose, arrived_us=now_us, acknowledged=hud.sequence
        )
