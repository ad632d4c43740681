"""How sure a share is that was counted in a number of runs."""

import math

# Of 95 % of a normal distribution, in standard deviations.
WIDTH = 1.959964


def wilson_interval(successes: int, runs: int) -> tuple[float, float]:
    """Return the bounds within which the true share lies in 95 % of such counts.

    E. B. Wilson, Probable inference, the law of succession, and statistical inference, Journal of
    the American Statistical Association 22, 1927. Without runs it may be any share.
    """
    if runs == 0:
        return 0.0, 1.0
    share, square = successes / runs, WIDTH * WIDTH
    middle = (share + 0.5 * square / runs) / (1.0 + square / runs)
    spread = math.sqrt(share * (1.0 - share) / runs + 0.25 * square / (runs * runs))
    half = WIDTH * spread / (1.0 + square / runs)
    # Of none and of all a bound is exact, and would be off by rounding.
    least = 0.0 if successes == 0 else middle - half
    return least, 1.0 if successes == runs else middle + half
