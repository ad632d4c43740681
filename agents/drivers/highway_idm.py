"""The vehicle of highway-env that drives by itself, `IDMVehicle`, in our races.

At each decision it is put on a lane that runs along the reference line ahead, among the karts that
are seen, and asked what it would do. It follows by the Intelligent Driver Model, and steers for the
middle of its lane. It knows no bends: the lane's speed limit is ours.
"""

import math
from typing import Any

import numpy as np

from race_server.core.driver import Briefing
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.core.vehicle_presets import TENTH
from race_server.core.vehicles import GRAVITY
from race_server.errors import DriverError
from race_server.scenario.highway import INSTALL, has_highway
from race_server.second.similarity import Similarity

# Share of the grip that bends may take, and of that which is planned to brake before them.
BEND_SHARE, BRAKE_SHARE = 0.5, 0.3
SLOWEST = 12.0  # [m/s] there, at least, when it steers
MOST_TURN = 1.2  # [rad] that a lane turns away at most
NOWHERE = 999.0  # [m] as far away as no kart is
LANE = ("here", "ahead", 0)


class HighwayIdm:
    """Follows the road as a vehicle of highway-env does: by its Intelligent Driver Model."""

    preset = "line"
    vehicles = (*TENTH, "kart-13", "kart-30")  # faster, it runs wide in narrow bends

    def __init__(self) -> None:
        """Check that highway-env is there.

        Raises:
            DriverError: it is not installed.
        """
        if not has_highway():
            raise DriverError(f"driver 'highway_idm' needs highway-env: {INSTALL}")

    def reset(self, briefing: Briefing) -> None:
        """Get ready for a new race."""
        from highway_env.vehicle.behavior import IDMVehicle

        self.vehicle = briefing.vehicle
        self.similar = Similarity.of([briefing.vehicle])
        length = self.similar.length * briefing.vehicle.wheelbase
        # It turns as a vehicle with axles this far apart.
        self._kind = type("Idm", (IDMVehicle,), {"LENGTH": length, "MAX_SPEED": math.inf})

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""
        values = observation.values.astype(np.float64)
        seen = {name: values[place] for name, place in observation.layout.slices.items()}
        if seen["lights"][0] > 0.0:
            return Control(0.0, 0.0, 1.0)
        idm = self._among(seen)
        idm.act()
        gain = float(idm.action["acceleration"])
        # Where it hardly moves it would make for the middle of its lane at 45°.
        idm.speed = max(idm.speed, SLOWEST)
        angle = idm.steering_control(LANE)
        vehicle = self.vehicle
        force = vehicle.mass * gain
        throttle = min(max(force / vehicle.motor_force, 0.0), 1.0)
        brake = min(max(-force / vehicle.brake_force, 0.0), 1.0)
        return Control(min(max(angle / vehicle.steering_limit, -1.0), 1.0), throttle, brake)

    def _among(self, seen: dict[str, Any]) -> Any:
        """Return the vehicle on a lane along the line, among the karts that are seen."""
        from highway_env.road.lane import PolyLaneFixedWidth
        from highway_env.road.road import Road, RoadNetwork
        from highway_env.vehicle.kinematics import Vehicle

        similar = self.similar
        ahead = np.stack([seen["line_ahead_x"], seen["line_ahead_y"]], axis=1)
        # Its lanes are looked through from their end: one that comes back is not understood.
        steps = np.diff(ahead, axis=0)
        turned = np.abs(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
        ahead = ahead[: max(int(np.argmax(turned > MOST_TURN)) or len(ahead), 2)]
        behind = ahead[0] - 4.0 * (ahead[1] - ahead[0])
        width = float((seen["line_left_ahead"] + seen["line_right_ahead"]).min())
        lane = PolyLaneFixedWidth(
            (similar.length * np.vstack([behind, ahead])).tolist(),
            width=similar.length * width,
            speed_limit=similar.pace * self._limit(seen),
        )
        network = RoadNetwork()
        network.add_lane(*LANE[:2], lane)
        road = Road(network)
        for x, y, pace in zip(seen["karts_x"], seen["karts_y"], seen["karts_speed_x"], strict=True):
            if math.hypot(x, y) < NOWHERE:
                place = [similar.length * float(x), similar.length * float(y)]
                road.vehicles.append(Vehicle(road, place, 0.0, similar.pace * float(pace)))
        speed = similar.pace * float(seen["speed"][0])
        idm = self._kind(road, [0.0, 0.0], 0.0, speed, LANE, lane.speed_limit)
        road.vehicles.append(idm)
        return idm

    def _limit(self, seen: dict[str, Any]) -> float:
        """Return the speed [m/s] from which all bends ahead can still be met."""
        grip = self.vehicle.grip * GRAVITY * float(seen["grip_scale"][0])
        bends = np.maximum(np.abs(seen["line_curvature_ahead"]), 1e-6)
        ways = float(seen["line_step"][0]) * np.arange(len(bends))
        squares = BEND_SHARE * grip / bends + 2.0 * BRAKE_SHARE * grip * ways
        return min(float(np.sqrt(squares.min())), float(seen["speed_cap"][0]))
