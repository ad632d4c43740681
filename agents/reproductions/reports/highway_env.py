"""highway-env's documented examples, on its environments and on ours in their place."""

from race_agents.reproductions.documented import ExamplesExam, HindsightExample, RoadExample
from race_agents.reproductions.plan import Column, Reproduction, TrainingScale, Variant
from race_server.envs.registration import PARK_COMPATIBLE, RACETRACK_COMPATIBLE


def _hindsight(cars: int, lessons: int, starts: int) -> tuple[str, ...]:
    """Return settings of the example that parks. lessons: after each decision of all cars."""
    return (
        "algorithm={name = 'sac', learning_rate = 1e-3}",
        "algorithm.options={buffer_size = 1000000, batch_size = 1024, gamma = 0.95, tau = 0.05, "
        f"learning_starts = {starts}, gradient_steps = {lessons}}}",
        "network.layers=[512, 512, 512]",
        f"worlds={cars}",
    )


_SMALLER = (
    "algorithm.options.batch_size=256",
    "algorithm.options.buffer_size=100000",
    "network.layers=[64, 64]",
)
_ROAD = (
    "algorithm={name = 'ppo', learning_rate = 5e-4}",
    "algorithm.options={n_steps = 128, batch_size = 64, n_epochs = 10, gamma = 0.9}",
    "network.layers=[256, 256]",
    "worlds=6",
)
_SHORTER = ("steps=10000",)
_MANY = 16
_ROADS = 5.0  # times as many decisions as the example that parks

REPRODUCTION = Reproduction(
    title="highway-env's documented examples, there and here",
    source="https://github.com/Farama-Foundation/HighwayEnv, scripts/parking_her.ipynb and "
    "scripts/sb3_racetracks_ppo.py; they print no figures",
    preset="parking-1",
    rows=(
        Variant(
            "SAC + HER, parking-v0",
            _hindsight(1, 1, 600),
            quick_changes=_SMALLER,
            lesson=HindsightExample("parking-v0"),
        ),
        Variant(
            "SAC + HER, ParkCompatible",
            _hindsight(1, 1, 600),
            quick_changes=_SMALLER,
            lesson=HindsightExample(PARK_COMPATIBLE),
        ),
        Variant(
            f"SAC + HER, ParkCompatible, {_MANY} at once",
            _hindsight(_MANY, _MANY // 4, 600 * _MANY),
            quick_changes=(*_SMALLER, "steps=48000"),
            steps_share=4.0,
            lesson=HindsightExample(PARK_COMPATIBLE),
        ),
        Variant("PPO, racetrack-v0", _ROAD, steps_share=_ROADS, lesson=RoadExample("racetrack-v0")),
        Variant(
            "PPO, RacetrackCompatible",
            _ROAD,
            steps_share=_ROADS,
            quick_changes=("steps=100000",),
            lesson=RoadExample(RACETRACK_COMPATIBLE),
        ),
    ),
    exam=ExamplesExam(),
    full=TrainingScale(steps=20_000, seeds=1, starts=100),
    quick=TrainingScale(steps=6_000, seeds=1, starts=30),
    their_heads=(),
    columns=(
        Column("own", "success, %", 1, of="starts"),
        Column("crash", "crashed, %", 1, of="starts", has_bounds=False),
        Column("learning_cpu_s", "learning, CPU s", 0),
        Column("decisions_a_second", "decisions a CPU s", 0),
    ),
    plotted=Column("own", "success, %", 1, of="starts"),
    assumptions=(
        "The programs are those of the documentation: `parking-v0` with `add_walls` off, SAC with "
        "4 goals in hindsight, 3 × 512 and batches of 1,024; `racetrack-v0` with PPO in 6 "
        "environments, 2 × 256. Only the name of the environment differs.",
        "A quick run has smaller networks, 2 × 64, and batches of 256 for SAC, and fewer "
        "decisions: 6,000 to park (16 at once: 48,000) instead of 20,000, 10,000 on highway-env's "
        "road instead of 100,000; on ours as many as printed.",
        "The 6 roads are in one process, in place of 6: processor time is then that of one core.",
        "The clock is processor time of one core while it learns: on an idle machine that is the "
        "time on the wall. Learning starts after 600 decisions of each car, once an episode is "
        "over.",
        f"{_MANY} at once: the vector form, with a lesson for every 4 decisions and four times the "
        "decisions, so as many lessons.",
        "Success is `parking-v0`'s own; on the road, for which there is none, a lap's time without "
        "leaving it and without a crash, which ends the episode.",
    ),
)
