"""What is to be learned: a task, and the discipline that its episodes belong to.

A discipline is all that the batch engine does not know: where a round begins, what a decision is
worth, when an episode is over. Racing is one, see `race_server.envs.racing`; another is another
package beside it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Protocol

from race_server.core.bounds import MOST_KARTS
from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.driver import driver_named
from race_server.core.observation import wants_line
from race_server.core.state import World
from race_server.envs.buffers import Buffers, Figures, Templates
from race_server.envs.called_opponent import CalledOpponent
from race_server.envs.reality_gap import RealityGap
from race_server.errors import ScenarioError
from race_server.scenario.checked import check_number, check_whole
from race_server.scenario.race import Scenario

# Takes the world, the buffers of the batch, and the templates of the discipline.
Kernel = Callable[[World, Buffers, Any], None]


class Discipline(Protocol):
    """What the batch engine asks of a discipline: names, figures, two kernels.

    The kernels are made of the stages in `envs/decision.py`, `envs/rounds.py` and
    `envs/observations.py`. Why two, and not one for each stage: see `envs/batch.py`.
    """

    @property
    def terms(self) -> Mapping[str, str]:
        """Reward terms and what each measures, in the order in which `decide` fills them."""

    @property
    def rewards(self) -> Mapping[str, Mapping[str, float]]:
        """Weights of the terms, in tables that have a name."""

    @property
    def settings(self) -> Mapping[str, float]:
        """What the kernels read as `buffers.settings` besides the fields of every discipline."""

    @property
    def figures(self) -> Figures:
        """The fields that it adds to the record of an episode, and those from before a decision."""

    @property
    def sensors(self) -> int:
        """Sensors that rewards and ends need on learning karts, bits of `codes`."""

    @property
    def outcome(self) -> str:
        """The key of an episode's figures in what Gymnasium calls `info`."""

    def scenarios_of(self, task: "Task") -> tuple[Scenario, ...]:
        """Return all scenarios that a reset may draw."""

    def begin(self, scenarios: Sequence[Scenario], worlds: int) -> tuple[World, Templates]:
        """Return `worlds` worlds, not yet reset, and a template of each scenario's start."""

    def beside(self, templates: Templates) -> Sequence[Any]:
        """Return the arrays (W, …) of its templates that change, so that a saved state has them."""

    def report(self, episode: Any) -> dict[str, Any]:
        """Return the discipline's own figures of an episode, a record of `buffers.ended`."""

    @property
    def restart(self) -> Kernel:
        """The kernel that begins a new round in every world."""

    @property
    def decide(self) -> Kernel:
        """The kernel that moves every world on by one decision."""

    @property
    def around(self) -> tuple[Kernel, Kernel]:
        """What `decide` does before its ticks and after them, for another simulator's ticks."""


@dataclass(frozen=True)
class Task:
    """What is to be learned: everything about a batch but its size."""

    scenarios: tuple[Scenario, ...]
    discipline: Discipline
    # Drivers of the karts that do not learn, repeated in turn: names, or functions.
    opponents: tuple[str | CalledOpponent, ...] = ()
    learners: int = 0  # 0: all karts without an opponent's name
    observation: str | tuple[str, ...] = "radar"
    action: str = "continuous"
    base: str = ""  # the driver that a residual action advises
    reward: str | Mapping[str, float] = "progress"
    gap: RealityGap = field(default_factory=RealityGap)
    decision_ticks: int = 3
    most_steps: int = 0  # decisions until an episode is cut off; 0: the rules alone end it
    simulator: str = ""  # that moves the bodies, see `race_server.second`; empty: ours

    def __post_init__(self) -> None:
        """Take lists for tuples, as files and people write them.

        Raises:
            ScenarioError: a setting is of another kind, or a number makes no episodes.
        """
        for name in ("scenarios", "opponents", "observation"):
            value = getattr(self, name)
            if not isinstance(value, str):
                object.__setattr__(self, name, tuple(value))
        if isinstance(self.opponents, str):
            raise ScenarioError(
                f"opponents = {self.opponents!r}: give a list of drivers, [{self.opponents!r}]"
            )
        if not isinstance(self.gap, RealityGap):
            raise ScenarioError(f"gap = {self.gap!r}: give a RealityGap")
        if not isinstance(self.reward, str | Mapping):
            raise ScenarioError(f"reward = {self.reward!r}: give the name of a table, or weights")
        for name, least in (("decision_ticks", 1), ("most_steps", 0), ("learners", 0)):
            check_whole(name, getattr(self, name), least)
        weights = {} if isinstance(self.reward, str) else self.reward
        for term, weight in weights.items():
            check_number(f"reward {term}", weight)

    def with_options(self, **options: Any) -> "Task":
        """Return the task with other options: its own, or those of its discipline.

        Raises:
            TypeError: neither has an option of that name.
        """
        own = {each.name for each in fields(self)}
        mine = {name: value for name, value in options.items() if name in own}
        rest = {name: value for name, value in options.items() if name not in own}
        if not rest:
            return replace(self, **mine)
        discipline: Any = mine.pop("discipline", self.discipline)
        known = {each.name for each in fields(discipline)}
        if unknown := sorted(rest.keys() - known):
            kind = type(discipline).__name__.lower()
            raise TypeError(
                f"a task of {kind} has no option {unknown[0]!r}; it has, besides those of the "
                "function that makes it, "
                f"{', '.join(sorted(own - {'scenarios', 'discipline'} | known))}"
            )
        return replace(self, discipline=replace(discipline, **rest), **mine)

    @property
    def decisions_per_s(self) -> int:
        """How often a kart decides, which is how fast a film of its decisions plays."""
        return round(TICKS_PER_SECOND / self.decision_ticks)

    @property
    def wants_line(self) -> bool:
        """Whether the learning karts, or the drivers among them, see a reference line."""
        drivers = (*self.opponents, self.base) if self.base else self.opponents
        presets = [
            (driver_named(each) if isinstance(each, str) else each).preset for each in drivers
        ]
        return any(wants_line(observation) for observation in (self.observation, *presets))

    def count_learners(self) -> int:
        """Return how many karts of each race learn.

        Raises:
            ScenarioError: none, or the others have no driver.
        """
        karts = self.scenarios[0].karts
        check_whole("karts", karts, 1, MOST_KARTS)
        if self.learners:
            learners = self.learners
        else:
            learners = max(karts - len(self.opponents), 1) if self.opponents else karts
        if not 1 <= learners <= karts or (learners < karts and not self.opponents):
            raise ScenarioError(
                f"{learners} learning karts of {karts}: choose 1 to {karts}, and name opponents "
                "for the others"
            )
        return learners
