"""`--gap` of an exam: the vehicle is another one than its driver takes it for."""

import math
from collections.abc import Sequence
from dataclasses import replace

from race_server.envs.reality_gap import FACTORS, RealityGap
from race_server.errors import ScenarioError

MOST = 1000.0  # of any factor: no vehicle is a thousand times another


def gap_of(asked: Sequence[str]) -> RealityGap:
    """Return the gap of texts such as mass=1.2.

    Raises:
        ScenarioError: a text has another form, the factor is unknown, a delay, or given twice.
    """
    names = [name for name, factor in FACTORS.items() if not factor.is_whole]
    gap, given = RealityGap(), set[str]()
    for text in asked:
        name, _, value = text.partition("=")
        try:
            factor = float(value)
        except ValueError:
            factor = math.nan
        if name not in names or not abs(factor) <= MOST:
            raise ScenarioError(
                f"--gap {text}: give FACTOR=VALUE, at most {MOST:g}, such as hitch=1.1; factors "
                f"are {', '.join(names)}"
            )
        if name in given:
            raise ScenarioError(f"--gap {text}: {name} is given twice; give each factor once")
        given.add(name)
        gap = replace(gap, **{name: (factor, factor)})
    gap.ranges()
    return gap
