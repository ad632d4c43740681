"""What all reproductions of the report on automatic parking of a kart share."""

from collections.abc import Sequence

from race_agents.reproductions.plan import Column
from race_server.envs.parking.reward_terms import REWARDS

SOURCE = "Report on automatic parking of a kart, 2022"

# Where there are no walls a kart that goes too far is 30 m away; walls cost as much.
WALL = {"crash": -1.0}


def reward(table: str, **changes: float) -> str:
    """Return a change of settings: a table of rewards with other weights."""
    weights = {**REWARDS[table], **changes}
    return "reward={" + ", ".join(f"{name} = {weight!r}" for name, weight in weights.items()) + "}"


def stages(distances: Sequence[tuple[float, float]], share: float) -> str:
    """Return a change of settings: a curriculum of starts nearer to the slot [m], then as the lot.

    The next stage begins once four of five of the last 200 episodes park, at the latest when its
    part of a share of the training is over.
    """
    starts = [number * share / len(distances) for number in range(len(distances) + 1)]
    near = [
        f"{{after = {start!r}, distance = {list(distance)!r}, until_success = 0.8}}"
        for start, distance in zip(starts, distances, strict=False)
    ]
    return f"curriculum=[{', '.join([*near, f'{{after = {starts[-1]!r}}}'])}]"


# Of the yard, where starts are 40 to 66 m away: five of them and the whole make six stages.
STEPS_OF_YARD = ((2.0, 8.0), (2.0, 16.0), (2.0, 28.0), (2.0, 42.0), (2.0, 56.0))
SIX_STAGES = stages(STEPS_OF_YARD, 0.5)

# The report prints a penalty of the distance in metres and none for a collision. Where a collision
# ends an episode it ends that penalty too, and to crash at once is what pays best.
BUMPS = 'race.rules={wall_contact = "bump", kart_contact = "bump"}'
BUMPS_WORD = (
    "In training a collision ends nothing and costs nothing: the report prints no penalty for it, "
    "and where it ends an episode, it ends the penalty of the distance too. In the exam it ends a "
    "way, which has failed."
)

# The final configuration, for scenario 2. With random brakes a kart hardly moves, and PPO never
# starts: the untrained network does not brake.
SCENARIO_2 = (
    'parking.lots=["yard-70-east"]',
    "parking.level=report-a-2",
    "observation=report_a",
    "action=report_a",
    reward("report_a_distance"),
    BUMPS,
    "network.first_action=[0.0, 0.0, -1.0]",
)
# Two more karts that drive what was learned before.
KARTS = (
    *SCENARIO_2,
    "race.karts=3",
    "race.learners=1",
    "race.opponents=['learned:parking-2']",
)

# Strengths that the report does not tell are those of the example Pyramids of its library
# (https://github.com/Unity-Technologies/ml-agents, config/imitation/Pyramids.yaml), which has the
# cloning that the report prints as well. A surprise counts as it is, cut at 1, as there.
CURIOSITY = ("curiosity.bonus=0.02", "curiosity.most=1.0")
GAIL = ("gail.scale=0.01", "gail.own_share=1.0")
CLONING = ("cloning.strength=0.5", "cloning.steps=150000")

# Of its network of 3 x 512; see `half_stack.py`.
HALVES = ("network.products=bfloat16",)
HALVES_WORD = (
    "Products between two layers have factors of bfloat16 (8 bits) where the processor has units "
    "for it, and sums of float32. The report's network multiplies float32."
)

# The report draws the place of a slot, and its network does not see how one lies, yet stands
# straight in nearly all: so its slots lie one way.
ONE_WAY = "Slots lie one way: the report draws their place, and its network does not see a heading."

STEPS = 4_000_000  # to which the learning rates of the preset belong

THEIR_HEADS = ("parked, %", "aligned, % of all", "aligned, % of parked", "remark")
PARKED = Column("parked", "parked, %", 1, of="starts")


def columns(*failures: str) -> tuple[Column, ...]:
    """Return what is shown, with the ways to fail that a lot has."""
    ways = {"late": "time", "left": "left"}
    return (
        PARKED,
        Column("aligned", "aligned, % of all", 1, of="starts"),
        Column("aligned", "aligned, % of parked", 1, of="parked"),
        *(
            Column(name, f"{ways.get(name, name)}, %", 1, of="starts", has_bounds=False)
            for name in failures
        ),
        Column("time_s", "time, s", 1),
        Column("settled_cpu_s", "CPU s to 90 %", 0),
        Column("learning_cpu_s", "learning, CPU s", 0),
    )


ASSUMPTIONS = (
    "Parked is what the report calls so: the middle of the body closer than 0.5 m to that of the "
    "slot, in scenario 2 for more than 1 s, counted in ticks of 1/60 s; aligned is within 10° "
    "besides. Each start is drawn by a seed that no training had.",
    "The kart is `kart-13`, whose speed is capped at 13 km/h; a decision takes 0.1 s (the report's "
    "demonstrations give 10 to 17 a second), so that a minute, its MaxSteps, is 600 of them.",
    "Around its zone are walls. In scenario 1 a collision with one ends an episode and costs 1, as "
    "much as to be too far away.",
    "Time that runs out is an end and not a cut, as the report's reward of -1 for it asks.",
    "It observes places in three dimensions, ours in two. Headings are in radians; it divides by "
    "360, which its normalisation undoes.",
    "Failures: time is up, left (too far from the slot), then what was run into.",
    "Processor time to 90 %: of this training, until the share of the last 100 episodes that "
    "parked, with exploration, first came to 90 % of its mean over the last tenth of the training. "
    "The report counts hours of a wall clock with stretches of a flat curve taken out.",
    "Each update is that of Stable-Baselines3's PPO.",
)
ZERO_AT = 200_000_000  # decisions at which the report's learning rate comes to zero


def rate(steps: int) -> tuple[str, str]:
    """Return the change of settings for the report's learning rate, and a sentence on it."""
    share = steps / ZERO_AT
    return f"algorithm.last_learning_rate={1e-4 * (1.0 - share):.3g}", (
        f"The learning rate falls by {share:.0%} to the end. The report's falls evenly to zero at "
        f"{ZERO_AT // 1_000_000} million steps, so by as much in the first {steps // 1_000_000} "
        "million."
    )


RATE_WORD = rate(STEPS)[1]  # of the preset
