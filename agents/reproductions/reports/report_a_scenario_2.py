"""Report on automatic parking, scenario 2: across a yard with blocks and a person."""

from race_agents.reproductions.plan import ParkingExam, Reproduction, TrainingScale, Variant
from race_agents.reproductions.report_a import (
    ASSUMPTIONS,
    BUMPS_WORD,
    HALVES,
    HALVES_WORD,
    ONE_WAY,
    PARKED,
    RATE_WORD,
    SCENARIO_2,
    SIX_STAGES,
    SOURCE,
    STEPS,
    THEIR_HEADS,
    WALL,
    columns,
    reward,
)

_ENDS = 'race.rules={wall_contact = "retire", kart_contact = "retire"}'


def _asked(name: str, remark: str, *changes: str) -> Variant:
    """Return a row that the report does not have."""
    return Variant(name, changes, theirs=("–", "–", "–", remark))


REPRODUCTION = Reproduction(
    title="Parking across a yard with blocks and a person: what explains the report's failures",
    source=f"{SOURCE}, scenario 2, final configuration; number of episodes not told",
    preset="report-a",
    changes=(*SCENARIO_2, SIX_STAGES, *HALVES),
    base="final",
    rows=(
        Variant(
            "final",
            theirs=("90", "–", "97", "about 1 day, with stages; collisions are what fails"),
            their_number=90.0,
        ),
        _asked(
            "a collision costs 1",
            "no penalty is printed",
            reward("report_a_distance", touch=-1.0),
        ),
        _asked("a collision ends an episode", "as printed, if it does", _ENDS),
        _asked(
            "a collision ends an episode and costs 1",
            "no penalty is printed",
            _ENDS,
            reward("report_a_distance", **WALL),
        ),
        _asked(
            "distance as a share of 70 m", "metres or a share: not said", reward("report_a_share")
        ),
        _asked("gamma 0.997", "0.99 forgets in 10 s", "algorithm.options.gamma=0.997"),
        _asked("30 km/h", "capped, as it did not learn to manage speed", "vehicle=kart-30"),
        _asked("unit vectors", "show no speed and no distance", "observation=report_a_unit"),
    ),
    exam=ParkingExam(),
    full=TrainingScale(steps=STEPS, seeds=3, starts=1000),
    quick=TrainingScale(steps=24_576, seeds=1, starts=100),
    their_heads=THEIR_HEADS,
    columns=columns("late", "wall", "block", "person"),
    plotted=PARKED,
    assumptions=(
        *ASSUMPTIONS,
        RATE_WORD,
        HALVES_WORD,
        ONE_WAY,
        BUMPS_WORD,
        "The penalty of the distance is of metres, which may sum to 66 in a minute; as a share of "
        "the 70 m of the yard it sums to 1 at most.",
        "The report takes that penalty away once the mean return no longer rises, to see it go to "
        "1; here it stays to the end.",
        "Blocks (6 to 10, of 1 to 2 m) and the ways of the person are our choice; walls are around "
        "the yard.",
        "All rows learn in the six stages of `report-a-curriculum`, as the report's figures are "
        "of a training in stages.",
        "The untrained network does not brake: with random brakes a kart hardly moves.",
    ),
)
