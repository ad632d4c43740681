"""The greatest numbers that a person may ask for, in an option, a file or a call.

Commands read them before anything is loaded, so this imports nothing.
"""

# Vehicles in a race or a car park, and the last seat of a session.
MOST_KARTS = 64
LAST_SEAT = MOST_KARTS - 1
# Attempts of a driver in a time trial, and rounds of races.
MOST_ROUNDS = 100
# A day. A clock overflows at numbers beyond reason [s].
MOST_S = 86_400.0
# Of a round in a car park [s].
LEAST_ROUND_S, MOST_ROUND_S = 1.0, 3600.0
