"""Which seeds are for what, so that no exam asks for a round that was trained on."""

# A training begins with smaller seeds; those from here on are for exams.
HELD_OUT = 1_000_000
# A training that is resumed goes on with seeds from here on.
RESUMED = 2**31
# A world keeps its seed in 64 bits with a sign.
MOST_SEED = 2**63 - 1


def resumed_seed(seed: int, done: int) -> int:
    """Return the seed that a training of `seed` resumes with after `done` decisions.

    It and those of a million worlds after it fit into the 32 bits that numpy takes.
    """
    return RESUMED + (seed + done) % (RESUMED - HELD_OUT)
