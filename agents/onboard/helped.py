"""A driver of a real kart whose pedals are helped: the same help as on the page.

What comes of it goes to the control unit as any driver's command does: the reflex stands above it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from race_agents.onboard.program import KnownKart
from race_server.coaching.assistance import Guide, Level, Pedals, Situation, assist
from race_server.core.driver import Briefing, Driver
from race_server.core.messages import Control, KartFlag, Phase, Status, Trust
from race_server.core.observation import Observation

# Without orders for longer than this [s] nothing is known of lights and flags: no help.
MOST_SILENCE_S = 1.0


@dataclass
class HelpedDriver:
    """Drives as another driver does, with help for the pedals."""

    driver: Driver
    level: Level
    guide: Guide
    kart: KnownKart
    clock: Callable[[], float]

    def __post_init__(self) -> None:
        """See what the driver wants to see."""
        self.preset = self.driver.preset

    def reset(self, briefing: Briefing) -> None:
        """Brief the driver."""
        self.driver.reset(briefing)

    def act(self, observation: Observation) -> Control:
        """Return the driver's control, with the pedals that the help leaves or makes of it."""
        control, situation = self.driver.act(observation), self._situation(observation)
        if situation is None:
            return control
        own = Pedals(control.throttle, control.brake)
        pedals = assist(self.level, own, situation, self.guide)
        return replace(control, throttle=pedals.throttle, brake=pedals.brake)

    def _situation(self, observation: Observation) -> Situation | None:
        """Return what the kart is in, None while that is not known."""
        pose, hud = self.kart.pose(), self.kart.hud
        if pose is None or hud is None or self.clock() - self.kart.hud_s > MOST_SILENCE_S:
            return None
        is_home = observation.scalar("finished") > 0.0
        is_racing = hud.trust is not Trust.SUSPENDED and not is_home
        return Situation(
            *(pose.x, pose.y, pose.heading, pose.speed, hud.speed_cap),
            phase=Phase.RUNNING,
            lights=int(hud.lights_s > 0.0),
            status=Status.RACING if is_racing else Status.FINISHED,
            kart_flags=KartFlag(0),
            flag=hud.flag,
        )
