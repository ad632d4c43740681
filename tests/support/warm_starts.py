"""A quick warm start."""

from stable_baselines3 import PPO

from race_agents.training.imitation import Imitation
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import read_settings
from support.trainings import untrained

QUICK = (
    "minutes=none",
    "steps=12000",
    "worlds=16",
    "threads=1",
    "tracks={names = ['oval']}",
    "lidar.rays=21",
    "network={layers = [32], activation = 'relu'}",
    "evaluation={tracks = {names = ['oval']}, seeds = 2, times = 1, seconds = 3.0}",
    "evaluation.final={names = ['oval']}",
    "algorithm.options={n_steps = 50, batch_size = 200, n_epochs = 1}",
    "warm_start.teacher=raceline",
    "warm_start.batch_size=256",
    "warm_start.lessons=24",
    "warm_start.learning_rate=3e-3",
    "warm_start.memory=10000",
    "warm_start.share=1.0",
    "warm_start.margin=none",
)


def settings(*changes: str) -> Settings:
    return read_settings("time-trial", [*QUICK, *changes])


def imitate(wanted: Settings) -> tuple[PPO, list[str]]:
    """Return a learner after its warm start, and what was said."""
    said: list[str] = []
    budget, world, learner = untrained(wanted)
    imitation = Imitation(wanted, learner, world, said.append)

    def passed(decisions: int) -> bool:
        budget.done += decisions
        return True

    imitation.go(budget, passed)
    imitation.close()
    world.close()
    return learner, said
