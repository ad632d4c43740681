"""Which seeds are for what, so that no exam asks for a round that was trained on."""

# A training begins with smaller seeds; those from here on are for exams.
HELD_OUT = 1_000_000
# A training that is resumed goes on with seeds from here on.
RESUMED = 2**31
# A world keeps its seed in 64 bits with a sign.
MOST_SEED = 2**63 - 1
