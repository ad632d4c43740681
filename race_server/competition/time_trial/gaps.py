"""Reality gaps by name: what a trial lets go wrong between the driver and the car."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from race_server.core.clock import TICK_S
from race_server.envs.reality_gap import MOST_DELAY, RealityGap
from race_server.errors import ScenarioError
from race_server.scenario.sensors import Lidar

DECISION_TICKS = 3
DECISION_S = DECISION_TICKS * TICK_S
CUSTOM = "custom"


@dataclass(frozen=True)
class Gap:
    """One setting. Each run draws from the ranges under its seed; a point means fixed."""

    name: str
    noise: float = Lidar().noise  # [m] standard deviation of a lidar range
    dropouts: float = 0.0  # share of lidar rays that come back as 0
    delay: int = 0  # decisions from an answer to its effect
    speed: tuple[float, float] = (1.0, 1.0)  # factor of top speed and motor: the battery
    lag: float = 0.0  # [s] time constant of pedals and wheel
    play: float = 0.0  # share of the steering range that is lost
    grip: tuple[float, float] = (1.0, 1.0)  # factor of the vehicle's grip

    def lidar(self) -> Lidar:
        """Return the lidar with its faults."""
        return replace(Lidar(), noise=self.noise, dropout=self.dropouts)

    def reality(self) -> RealityGap:
        """Return what the training world calls this setting."""
        return RealityGap(
            action_delay=(self.delay, self.delay),
            actuator_lag=(self.lag, self.lag),
            steering_play=(self.play, self.play),
            speed_coefficient=self.speed,
            grip=self.grip,
        )

    def words(self) -> str:
        """Return what this setting changes, for a person."""
        nominal, parts = Gap(""), []
        if self.noise != nominal.noise:
            parts.append(f"lidar noise {100.0 * self.noise:g} cm")
        if self.dropouts:
            parts.append(f"{100.0 * self.dropouts:g} % of the lidar rays drop out")
        if self.delay:
            parts.append(f"answers act {1000.0 * self.delay * DECISION_S:.0f} ms late")
        if self.speed != nominal.speed:
            parts.append(f"motor and top speed {_range_words(self.speed)}")
        if self.lag:
            parts.append(f"pedals and wheel follow with {1000.0 * self.lag:g} ms")
        if self.play:
            parts.append(f"{100.0 * self.play:g} % play in the steering")
        if self.grip != nominal.grip:
            parts.append(f"grip {_range_words(self.grip)}")
        return ", ".join(parts) or "the nominal car, lidar noise 1 cm"


def _range_words(factors: tuple[float, float]) -> str:
    low, high = (100.0 * factor for factor in factors)
    return f"{low:g} to {high:g} %"


NONE = Gap("none")
# The faults that the 1/10 race's report names: lidar noise and drop-outs, an unregulated motor
# whose speed varies with the battery, play in the steering. Their sizes are our choice: three
# times the simulator's noise, every twentieth ray, one decision of delay, ±10 % of speed.
_ALL = Gap("all", 0.03, 0.05, 1, (0.9, 1.1), 0.05, 0.05, (0.9, 1.1))
GAPS = {
    gap.name: gap
    for gap in (
        NONE,
        Gap("noise", noise=_ALL.noise),
        Gap("dropouts", dropouts=_ALL.dropouts),
        Gap("delay", delay=_ALL.delay),
        Gap("battery", speed=_ALL.speed),
        Gap("lag", lag=_ALL.lag),
        Gap("play", play=_ALL.play),
        Gap("grip", grip=_ALL.grip),
        _ALL,
    )
}


def gaps_named(names: Sequence[str]) -> list[Gap]:
    """Return the settings of these names.

    Raises:
        ScenarioError: there is none of a name.
    """
    for name in names:
        if name not in GAPS:
            raise ScenarioError(
                f"reality gap {name!r} is unknown; choose from {', '.join(GAPS)}, or give "
                "--noise, --dropouts, --delay-ms"
            )
    return [GAPS[name] for name in names]


def custom_gap(noise: float | None, dropouts: float | None, delay_ms: float | None) -> Gap | None:
    """Return the setting of single figures, None without any.

    noise: [m]; dropouts: share of rays; delay_ms: a whole number of decisions.

    Raises:
        ScenarioError: a figure is out of range.
    """
    if noise is None and dropouts is None and delay_ms is None:
        return None
    gap = Gap(CUSTOM)
    if noise is not None:
        if not 0.0 <= noise <= 1.0:
            raise ScenarioError(f"lidar noise {noise:g} m: choose 0 to 1 m")
        gap = replace(gap, noise=noise)
    if dropouts is not None:
        if not 0.0 <= dropouts <= 1.0:
            raise ScenarioError(f"drop-outs {dropouts:g}: give a share of the rays from 0 to 1")
        gap = replace(gap, dropouts=dropouts)
    if delay_ms is not None:
        gap = replace(gap, delay=_decisions(delay_ms))
    return gap


def _decisions(delay_ms: float) -> int:
    step_ms = 1000.0 * DECISION_S
    delay = round(delay_ms / step_ms)
    if abs(delay * step_ms - delay_ms) > 0.5 or not 0 <= delay <= MOST_DELAY:
        raise ScenarioError(
            f"delay {delay_ms:g} ms: drivers decide every {step_ms:.0f} ms, choose a multiple of "
            f"that up to {MOST_DELAY * step_ms:.0f} ms"
        )
    return delay
