"""Report of the kart laboratory, figures 30 to 33: what helps learning, here for racing."""

from race_agents.reproductions.plan import Column, Exam, Reproduction, TrainingScale, Twist, Variant
from race_agents.training.settings import Tracks


def _buffer(agents: int, horizon: int) -> tuple[str, ...]:
    return (f"worlds={agents}", f"algorithm.options.n_steps={horizon}")


def _network(width: int, depth: int) -> tuple[str, ...]:
    return (f"network.layers={[width] * depth}",)


REPRODUCTION = Reproduction(
    title="Aids to learning: agents at once, normalisation, network, buffer, horizon",
    source="Report of the kart laboratory, figures 30, 32 and 33: learning to park with PPO",
    preset="time-trial-ppo",
    changes=(
        "tracks.set=train-few",
        *_buffer(128, 32),
        *_network(512, 3),
        "algorithm.learning_rate=1e-4",
        "algorithm.last_learning_rate=0.0",
        "algorithm.options.batch_size=1024",
        "algorithm.options.n_epochs=3",
        "algorithm.options.gamma=0.99",
        "algorithm.options.gae_lambda=0.95",
        "algorithm.options.clip_range=0.2",
        "algorithm.options.ent_coef=1e-4",
    ),
    base="base",
    rows=(
        Variant("base", theirs=("its final settings: about 5 times as fast as the defaults",)),
        Variant("8 agents", _buffer(8, 512), theirs=("converges in 4 h 30, on a slower computer",)),
        Variant("32 agents", _buffer(32, 128), theirs=("converges in 1 h 50",)),
        Variant("256 agents", _buffer(256, 16), theirs=("converges in 1 h 30",)),
        Variant(
            "no normalisation",
            twist=Twist(scaling="none"),
            theirs=("slower; observations must be normalised",),
        ),
        Variant("width 128", _network(128, 3), theirs=("slower, less steady than 512",)),
        Variant("width 256", _network(256, 3), theirs=("between 128 and 512",)),
        Variant("depth 1", _network(512, 1), theirs=("slower, less steady than 3",)),
        Variant("depth 2", _network(512, 2), theirs=("between 1 and 3",)),
        Variant(
            "large buffer",
            _buffer(128, 3200),
            theirs=("409600 instead of 4096: slower; smaller is better",),
            quick_changes=_buffer(128, 192),
        ),
        Variant("horizon 2048", _buffer(2, 2048), theirs=("slower; shorter is better",)),
    ),
    exam=Exam(Tracks(set="validation"), alone=True, random_start=False, seeds=2),
    full=TrainingScale(steps=2_048_000, seeds=3, exam_s=60.0),
    quick=TrainingScale(steps=49_152, seeds=1, exam_s=20.0),
    their_heads=("finding",),
    columns=(
        Column("learning_return", "return while learning"),
        Column("reward", "reward of a decision", 3),
        Column("speed", "speed, m/s"),
        Column("crashes_per_minute", "crashes/min", 1),
        Column("learning_cpu_s", "learning, CPU s", 0),
    ),
    plotted=Column("learning_return", "return while learning"),
    assumptions=(
        "The report parks; here the same aids are tried on racing alone against the clock, so that "
        "its findings and ours can be compared in direction only.",
        "Agents at once, buffer and horizon: Stable-Baselines3 ties them together, as the buffer "
        "is agents times horizon. At a buffer of 4096 more agents mean a shorter horizon: 128 "
        "times 32 in the base, 8 times 512, 32 times 128, 256 times 16, and 2 times 2048 for the "
        "longest horizon. The report's library cuts its buffer into horizons of any length.",
        "The large buffer is 409600 decisions, in a quick run 24576: half of what it has.",
        "It counts hours on different computers; here all rows have the same number of decisions, "
        "and the processor time of learning is told.",
        "The return while learning is the mean over the whole training of the last hundred "
        "episodes' return: higher the earlier something is learned. Among many agents the short "
        "episodes are over first, which lowers it in short trainings.",
        "Curiosity, imitation and the penalty for a crooked stop are about parking and left out.",
    ),
)
