"""What all reproductions of the report of the 1/10 race share."""

from agents.reproductions.plan import Twist

# It divides what the car sees by the largest values that can be.
OWN = Twist(scaling="largest")
GROWING_CRASH = Twist(scaling="largest", growing_crash=True)
STEPS_OF_2 = Twist(scaling="largest", steering_share=2.0 / 9.0)

ASSUMPTIONS = (
    "Increments of speed lie between 0 and 1, as its action space is printed: a policy can keep "
    "the speed that is set or raise it, but never lower it. Elsewhere it speaks of cars that slow "
    "down and, on the real car, of negative increments; then its cars could do more than ours.",
    "Decisions are 0.05 s apart and scans 0.1 s; the report does not say how long a step is.",
    "A touch of a wall or a car is a crash, besides a range under 120 mm.",
    "Other cars are the driver `avoider`; the network has two layers of 64, the library's default.",
)
