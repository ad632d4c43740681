"""Several karts and one gate: paid each for itself, paid together, MAPPO and MA-POCA."""

from race_agents.reproductions.plan import (
    Column,
    ParkingExam,
    Reproduction,
    TrainingScale,
    Variant,
)
from race_agents.reproductions.report_a import columns

SIZES = (2, 4, 8)
_WAYS = (
    ("PPO, own reward", ("algorithm.name=ppo",)),
    ("PPO, team reward", ("algorithm.name=ppo", "parking.team=true")),
    ("MAPPO, team reward", ("algorithm.name=mappo", "parking.team=true")),
    ("MA-POCA", ("algorithm.name=poca",)),
)
ALL_PARKED = Column("all_parked", "all parked, %", 1, of="rounds")

REPRODUCTION = Reproduction(
    title="Several karts through one gate, each to a slot",
    source="no report: a comparison of this program's learners, as that of MA-POCA in Cohen et "
    "al., 2021, https://arxiv.org/abs/2111.05992, on other tasks",
    preset="park-gate",
    changes=("network.last_log_std=none",),
    rows=tuple(
        Variant(
            f"{karts} karts, {name}", (f"race={{karts = {karts}, learners = {karts}}}", *changes)
        )
        for karts in SIZES
        for name, changes in _WAYS
    ),
    exam=ParkingExam(),
    full=TrainingScale(steps=8_000_000, seeds=3, starts=1000),
    quick=TrainingScale(steps=32_768, seeds=1, starts=20, changes=("worlds=32",)),
    their_heads=(),
    columns=(
        ALL_PARKED,
        Column("contacts", "rounds with a contact, %", 1, of="rounds"),
        Column("stuck", "stuck, %", 1, of="rounds"),
        *columns("late", "wall", "block", "vehicle"),
    ),
    plotted=ALL_PARKED,
    assumptions=(
        "The lot is `gate`: one gate of 3.5 m between the start zone and two rows of 8 bays. All "
        "karts start at once, in the zone before the gate; 30 % of the other bays are taken.",
        "Parked is closer than 0.5 m for a second; all have 90 s. A round counts as stuck if time "
        "ran out for a car and none ran into anything: they wait for one another, or are slow.",
        "Starts are those of single karts: a round has as many as there are karts in it. Each row "
        "learns from as many decisions of karts, those of karts that wait for the others included.",
        "PPO with its own reward leaves out what a kart decides once it is done. PPO with the team "
        "reward, the mean of all, learns on from karts that are done, until the last is: absorbing "
        "states. MAPPO is the same with a critic that knows the state of the lot. MA-POCA has "
        "the same reward, a critic that attends to the karts on their way, and a baseline for each "
        "that knows the actions of the others.",
        "The deviation of the actions is learned here; by itself the preset lets it fall evenly.",
        "An exam draws other slots and starts than any training. The seeds of rows are the same.",
    ),
)
