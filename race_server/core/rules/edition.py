"""Editions of the rule book as code: when the same settings came to mean another race.

A recording says by which edition it was driven, so that it is the same race when driven again.
"""

FIRST = 1  # that of recordings which do not say
# A lap driven wholly on the grass is not clean. A contact is new if it is so for one of the two
# karts. A pulse acts on the next kart ahead that races, and is kept where there is none. The time
# limit of a race ends with its last tick, and no longer one tick later.
SECOND = 2
NEWEST = SECOND
