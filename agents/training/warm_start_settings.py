"""Settings of the warm start of a training."""

from typing import Literal

from pydantic import Field

from race_agents.training.settings_table import Deviations, File, Table
from race_server.core.free_space.state_costs import CELL

IMITATED_LOG_STD = -2.0


class WarmStart(Table):
    """Imitation before PPO learns by reward; without teacher and demonstrations there is none."""

    # A scripted driver, which may see more than the learner; in a lot `planner`, see
    # `agents/training/greedy_teacher.py`.
    teacher: str = ""
    # To a teacher that takes it, as a residual action, see `race_server.envs.actions`.
    advice: tuple[float, ...] = ()
    # Greatest distance [m] between the learner and the lane that the teacher remembers, which a
    # learner cannot observe; None: no limit.
    lane_reach: float | None = Field(default=None, ge=0.0)
    demonstrations: File = ""  # a file of `race demonstrate`
    # A run with the same network and observation: what was best there is the beginning. With
    # neither teacher nor demonstrations PPO goes on from it at once.
    run: str = ""
    # The same of a policy file, or of a bundled policy by its name. What values are worth it does
    # not say, so the critic learns alone at first.
    policy: str = ""
    share: float = Field(default=0.5, gt=0.0, le=1.0)  # of the training
    critic_share: float = Field(default=0.05, ge=0.0, le=1.0)  # then; the critic learns alone
    critic_learning_rate: float | None = Field(default=None, gt=0.0)  # then; None: as afterwards
    # Then. None: -2 after imitation, as what is learned already needs less trying out; with
    # `policy` that of the network.
    log_std: Deviations | None = None
    # The share of steps that the teacher drives falls from all to none in this share of it.
    teacher_drives: float = Field(default=0.125, ge=0.0, le=1.0)
    teacher_keeps: float = Field(default=0.0, ge=0.0, le=1.0)  # the least share; not none
    stretch: int = Field(default=1, ge=1)  # decisions in a row that one of both drives, on average
    # Of the planner: side of the cells [m] of its costs to go, for a wheelbase or bar of 7.7 m.
    cell: float = Field(default=CELL, ge=0.2, le=1.0)
    caution: float = Field(default=1.0, gt=0.0, le=1.0)  # share of its line's speeds
    margin: float | None = Field(default=None, ge=0.0)  # [m] of its line; None: as in a race
    noise: float = Field(default=0.05, ge=0.0)  # standard deviation of what is driven
    memory: int = Field(default=2**20, ge=1)  # labels that are kept
    decisions: int = Field(default=16, ge=1)  # of each kart between lessons
    lessons: int = Field(default=6, ge=1)
    batch_size: int = Field(default=2048, ge=1)
    learning_rate: float = Field(default=1e-3, gt=0.0)
    last_learning_rate: float = Field(default=1e-5, ge=0.0)
    # Inputs are stretched until they are uncorrelated, but for directions of less variance.
    floor: float = Field(default=3e-3, gt=0.0)
    loss: Literal["squared", "absolute", "huber"] = "squared"
    steering_weight: float = Field(default=1.0, ge=0.0)  # of its error, against the pedals'
    # Of the pedals that fit what is seen, full brake first, the one that is learned: below one half
    # the learner is careful where it cannot see what its teacher knows.
    quantile: float = Field(default=0.5, gt=0.0, lt=1.0)

    @property
    def is_wanted(self) -> bool:
        """Whether there is a teacher or a demonstration to imitate."""
        return bool(self.teacher or self.demonstrations)

    @property
    def imitated_log_std(self) -> Deviations:
        """The logarithms of the first deviations after imitation."""
        return IMITATED_LOG_STD if self.log_std is None else self.log_std

    @property
    def end(self) -> float:
        """The share of the training at which it is over."""
        return self.share if self.is_wanted else 0.0

    @property
    def critic_end(self) -> float:
        """The share of the training from which the actor learns by reward."""
        alone = self.critic_share if self.is_wanted or self.policy else 0.0
        return self.end + alone
