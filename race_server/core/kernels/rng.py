"""Random numbers without a state: each follows from seed, stream and counters alone.

The order in which karts or worlds are stepped, the size of a batch and the number of threads
make no difference. Mixing: the finaliser of SplitMix64 (Steele, Lea, Flood 2014).
"""

import numpy as np

from race_server.core.kernels.jit import kernel

# Streams: one per use, so that no two uses read the same number.
ITEM_STREAM = 1
LIDAR_STREAM = 2
RADAR_STREAM = 3
START_STREAM = 4
RESPAWN_STREAM = 5
SCENARIO_STREAM = 6
GAP_STREAM = 7
EPISODE_STREAM = 8
GRID_STREAM = 9
SLOT_STREAM = 10
TAKEN_STREAM = 11
BLOCK_STREAM = 12
PLACE_STREAM = 13
WALKER_STREAM = 14

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_S30 = np.uint64(30)
_S27 = np.uint64(27)
_S31 = np.uint64(31)
_S11 = np.uint64(11)
_S16 = np.uint64(16)
_S32 = np.uint64(32)
_S48 = np.uint64(48)
_LOW_16 = np.uint64(0xFFFF)
_UNIT = 1.0 / 9007199254740992.0  # 2^-53


@kernel
def mix(value: np.uint64) -> np.uint64:
    """Return 64 well mixed bits that follow from the 64 bits of `value`."""
    value = (value ^ (value >> _S30)) * _MIX_1
    value = (value ^ (value >> _S27)) * _MIX_2
    return value ^ (value >> _S31)


@kernel
def bits(seed: int, stream: int, first: int, second: int) -> np.uint64:
    """Return 64 random bits for a seed, a stream and two counters.

    stream: one of the streams above; first, second: counters, such as tick and kart.
    """
    value = mix(np.uint64(seed) + _GOLDEN * np.uint64(stream))
    value = mix(value + _GOLDEN * np.uint64(first))
    return mix(value + _GOLDEN * np.uint64(second))


@kernel
def uniform(seed: int, stream: int, first: int, second: int) -> float:
    """Return a number in [0, 1) for a seed, a stream and two counters.

    stream, first, second: as for `bits`.
    """
    return float(bits(seed, stream, first, second) >> _S11) * _UNIT


@kernel
def normal_of(random: np.uint64) -> float:
    """Return a number of mean 0 and deviation 1 made of 64 random bits.

    The sum of four uniform numbers (Irwin-Hall): bell-shaped, never beyond 3.47, no logarithm.
    """
    total = (
        float(random & _LOW_16)
        + float((random >> _S16) & _LOW_16)
        + float((random >> _S32) & _LOW_16)
        + float(random >> _S48)
    )
    # Mean 4 · 65535 / 2; the variance of one is (65536² - 1) / 12.
    return (total - 131070.0) * (1.0 / 37837.2)
