"""Report of the 1/10 race, 2023, table 5.1: which algorithm earns most in 100 000 steps."""

from race_agents.reproductions.plan import (
    DRIVING,
    Column,
    Exam,
    Reproduction,
    TrainingScale,
    Twist,
    Variant,
)
from race_agents.reproductions.report_b import ASSUMPTIONS, OWN, as_printed
from race_agents.training.settings import Tracks

_PLAIN = ("algorithm.learning_rate=5e-4",)

REPRODUCTION = Reproduction(
    title="Three algorithms on the task of the 1/10 race",
    source="Report of the 1/10 race, table 5.1: 100 000 steps, learning rate 5e-4, mean of 10 runs",
    preset="report-b",
    rows=(
        Variant("PPO", _PLAIN, OWN, ("3.86", "converges fastest"), 3.8601),
        Variant(
            "DQN",
            (*_PLAIN, "algorithm.name=dqn", "algorithm.options={}", "action=discrete"),
            Twist(scaling="largest", choices=True),
            ("2.65", "always drives into the wall"),
            2.6487,
        ),
        Variant(
            "SAC",
            (*_PLAIN, "algorithm.name=sac", "algorithm.options={}"),
            OWN,
            ("0.97", "slows down to avoid walls; at times swings before one"),
            0.9715,
        ),
        as_printed("PPO", *_PLAIN),
    ),
    exam=Exam(Tracks(set="train-2023"), alone=False, random_start=True),
    full=TrainingScale(steps=100_000, seeds=10, exam_s=180.0),
    quick=TrainingScale(steps=6_144, seeds=2, exam_s=60.0),
    their_heads=("mean reward", "remark"),
    columns=(
        Column("reward", "reward of a decision"),
        *DRIVING,
    ),
    plotted=Column("reward", "mean reward"),
    assumptions=(
        *ASSUMPTIONS,
        "The report does not say what its mean reward is the mean of. Ours is that of a decision "
        "after the training, without exploration, crashes of -300 included.",
        "It takes the table from an earlier internship whose reward it does not print; ours is "
        "the report's own, so that rather the order than the figures can be compared.",
        "It does not say how DQN, which picks one of a few actions, moves the car. Ours picks "
        "from 3 increments of speed by 5 of steering.",
        "Besides the learning rate DQN and SAC have the defaults of Stable-Baselines3.",
    ),
)
