"""PPO with gradients written out beside the class of Stable-Baselines3 that it replaces."""

from race_agents.reproductions.plan import (
    DRIVING,
    Column,
    Exam,
    Reproduction,
    TrainingScale,
    Variant,
)
from race_agents.training.settings import Tracks

REPRODUCTION = Reproduction(
    title="PPO with gradients written out, and Stable-Baselines3's class",
    source="no report: a comparison of this program's learner with the class that it replaces",
    preset="time-trial-ppo",
    rows=(
        Variant("ppo"),
        Variant("ppo-sb3", ("algorithm.name=ppo-sb3",)),
    ),
    exam=Exam(Tracks(names=("covapsy-test-2023",)), alone=True, random_start=False),
    full=TrainingScale(steps=2_000_000, seeds=5, exam_s=60.0),
    quick=TrainingScale(steps=40_000, seeds=2, exam_s=10.0),
    their_heads=(),
    columns=(
        Column("learning_return", "return, mean of the training", 1),
        *DRIVING,
    ),
    plotted=Column("learning_return", "return, mean of the training"),
    assumptions=(
        "Both draw the same starts, noise and minibatches from a seed. Their steps differ by "
        "rounding, which a training multiplies, so that they are compared as two samples of five.",
        "The bands of the picture are the least and the greatest of the seeds.",
    ),
)
