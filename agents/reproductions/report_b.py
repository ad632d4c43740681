"""What all reproductions of the report of the 1/10 race share."""

from race_agents.reproductions.plan import Twist, Variant

# It divides what the car sees by the largest values that can be.
OWN = Twist(scaling="largest")
GROWING_CRASH = Twist(scaling="largest", growing_crash=True)
STEPS_OF_2 = Twist(scaling="largest", steering_share=2.0 / 9.0)


def as_printed(name: str, *changes: str) -> Variant:
    """Return the row of a car whose speed only rises, which the report's tables do not have."""
    return Variant(f"as printed: {name}, never slower", (*changes, "action=report_b"), OWN)


ASSUMPTIONS = (
    "Increments of speed lie between -1 and 1. The report prints 0 to 1, with which a car can keep "
    "the speed that is set or raise it, but never lower it; but its remarks are of cars that slow "
    "down, and its real car had negative increments. The row 'as printed' is without them.",
    "The report prints a reward of 12 times the nearest range and 3 times the speed, and no units. "
    "Here the range is a share of the 12 m that a lidar reaches, the speed in m/s: the reading of "
    "the four in `report-b-units` by which its base network drives most laps. "
    "With the range in metres a car that stands in the middle of the road earns well, and networks "
    "slower than 0.1 m/s found that.",
    "Decisions are 0.05 s apart and scans 0.1 s; the report does not say how long a step is.",
    "A touch of a wall or a car is a crash, besides a range under 120 mm.",
    "Other cars are the driver `avoider`; the network has two layers of 64, the library's default.",
)
