"""What every driver here does alike: when to use an item, and how to get free when stuck."""

from dataclasses import dataclass, field

from race_server.driver import Briefing
from race_server.messages import Button, Control
from race_server.observe import Observation

# A kart that should drive and moves slower than this [m/s] is not getting anywhere.
STANDING = 0.15


@dataclass
class Tactics:
    """Uses items and backs out of a jam; wraps what a driver wants to do."""

    briefing: Briefing
    standing_s: float = 0.0
    reversing_s: float = 0.0
    escape_steering: float = 0.0
    attempts: int = 0
    pressed: bool = False
    names: tuple[str, ...] = field(default=())

    def apply(self, observation: Observation, wanted: Control) -> Control:
        """Return `wanted`, with buttons, or the way out of a jam instead."""
        if observation.scalar("lights") > 0.0 or observation.scalar("finished") > 0.0:
            return Control(brake=1.0)
        buttons = self._buttons(observation, wanted)
        if observation.scalar("wrong_way") > 0.0:
            # Turned round in a crowd: to stand still is the way to be put back on the line.
            return Control(brake=1.0, buttons=buttons)
        escape = self._escape(observation, wanted)
        control = escape or wanted
        return Control(control.steering, control.throttle, control.brake, buttons)

    def _buttons(self, observation: Observation, wanted: Control) -> Button:
        buttons = Button.NONE
        # A button acts when it goes down, so it is let go after each press.
        self.pressed = not self.pressed and self._wants_item(observation, wanted)
        if self.pressed:
            buttons |= Button.USE_ITEM
        if observation.scalar("rescue_offered") > 0.0:
            buttons |= Button.ACCEPT_RESCUE
        return buttons

    def _wants_item(self, observation: Observation, wanted: Control) -> bool:
        number = round(observation.scalar("item"))
        if number <= 0:
            return False
        name = self.briefing.items[number - 1] if number <= len(self.briefing.items) else ""
        if name == "boost":
            return abs(wanted.steering) < 0.35 and wanted.throttle > 0.5
        if name == "pulse":
            return observation.scalar("rank") > 1.5
        if name == "oil":
            return observation.scalar("speed") > 1.0 and self._is_followed(observation)
        return True

    def _is_followed(self, observation: Observation) -> bool:
        """Return whether a kart is close behind; who cannot know drops what it has."""
        if "karts_x" not in observation.layout.slices:
            return True
        near = 8.0 * self.briefing.vehicle.length
        return bool(((observation["karts_x"] < 0.0) & (observation["karts_x"] > -near)).any())

    def _escape(self, observation: Observation, wanted: Control) -> Control | None:
        step = self.briefing.decision_s
        if self.reversing_s > 0.0:
            self.reversing_s -= step
            return Control(self.escape_steering, -1.0)
        held = observation.scalar("flag") > 1.5
        moving = abs(observation.scalar("speed")) > STANDING
        if moving or held:
            self.standing_s = 0.0
            if observation.scalar("speed") > 1.0:
                self.attempts = 0
            return None
        self.standing_s += step
        if self.standing_s > 0.6:
            # Back out with the wheels turned the other way; longer each time it did not help.
            self.attempts += 1
            self.standing_s = 0.0
            self.reversing_s = 0.4 + 0.2 * min(self.attempts, 4)
            self.escape_steering = -1.0 if wanted.steering >= 0.0 else 1.0
            if self.attempts % 3 == 0:
                self.escape_steering = 0.0
        return None


def throttle_for(speed: float, target: float, gain: float) -> tuple[float, float]:
    """Return throttle and brake that bring `speed` to `target` [m/s]; gain per m/s."""
    error = gain * (target - speed)
    if error >= 0.0:
        return min(error, 1.0), 0.0
    return 0.0, min(-0.5 * error, 1.0)
