"""Report on automatic parking, scenario 1: start and slot anywhere in a zone, no obstacles."""

from race_agents.reproductions.plan import ParkingExam, Reproduction, TrainingScale, Twist, Variant
from race_agents.reproductions.report_a import (
    ASSUMPTIONS,
    HALVES,
    HALVES_WORD,
    ONE_WAY,
    PARKED,
    SOURCE,
    THEIR_HEADS,
    WALL,
    columns,
    rate,
    reward,
)

_NOTHING = "–"
# To park is learned in four to five million decisions, to stand straight in nine or more.
_STEPS = 12_000_000
_RATE, _RATE_WORD = rate(_STEPS)
_ANY_HEADING = 'parking.lots=["zone-30"]'

REPRODUCTION = Reproduction(
    title="Parking in a zone of 30 m: rewards and observations",
    source=f"{SOURCE}, scenario 1: 2165 of 2209 episodes parked, 2154 of them aligned",
    preset="report-a",
    changes=('parking.lots=["zone-30-east"]', _RATE, *HALVES),
    rows=(
        Variant(
            "configuration 1",
            ("observation=report_a_1", reward("report_a_1", **WALL)),
            Twist(scaling="none"),
            (*[_NOTHING] * 3, "circles backwards into the slot, crooked; learned in 1 h"),
        ),
        Variant(
            "configuration 2, crooked costs 0.1",
            ("reward.misparked=-0.1",),
            theirs=(*[_NOTHING] * 3, "begins better than with 0.5, ends worse"),
        ),
        Variant(
            "configuration 2, crooked costs 0.5",
            theirs=("98.0 [97.3, 98.5]", "97.5", "99.5", "the one that is counted"),
            their_number=98.0,
        ),
        Variant(
            "slots of any heading",
            (_ANY_HEADING,),
            theirs=(*[_NOTHING] * 3, "not tried: its network cannot know how the slot lies"),
        ),
        Variant(
            "slots of any heading, which is observed",
            (
                _ANY_HEADING,
                'observation=["position_x", "position_y", "slot_x", "slot_y", "slot_heading", '
                '"heading", "velocity_x", "velocity_y", "to_slot_x", "to_slot_y"]',
            ),
            theirs=(*[_NOTHING] * 3, "not tried"),
        ),
        Variant(
            "unit vectors",
            ("observation=report_a_2_unit",),
            theirs=(*[_NOTHING] * 3, "what its figure 50 prints; not said of this simulator"),
        ),
    ),
    exam=ParkingExam(),
    full=TrainingScale(steps=_STEPS, seeds=3, starts=1000),
    quick=TrainingScale(steps=49_152, seeds=1, starts=100),
    their_heads=THEIR_HEADS,
    columns=columns("late", "left", "wall"),
    plotted=PARKED,
    assumptions=(
        *ASSUMPTIONS,
        _RATE_WORD,
        HALVES_WORD,
        ONE_WAY,
        "Its interval of 95 % is Wilson's, reckoned here from its counts.",
        "Per step it takes 0.001 for reversing and for wheels turned by more than 15°: 0.6 of a "
        "minute.",
    ),
)
