"""Rewards: the terms of a discipline, weighed by a table."""

from collections.abc import Mapping

import numpy as np

from race_server.core.state import Floats
from race_server.errors import ScenarioError


def weights_of(
    reward: str | Mapping[str, float],
    terms: Mapping[str, str],
    tables: Mapping[str, Mapping[str, float]],
) -> Floats:
    """Return the weight of every term, shape (T,), in the order of `terms`.

    reward: a mapping from terms to weights, or the name of one of the `tables`.

    Raises:
        ScenarioError: no such table or term.
    """
    if isinstance(reward, str):
        if reward not in tables:
            known = ", ".join(tables)
            raise ScenarioError(f"reward {reward!r} is unknown; choose one of {known}")
        reward = tables[reward]
    unknown = sorted(set(reward) - set(terms))
    if unknown:
        raise ScenarioError(
            f"reward term {unknown[0]!r} is unknown; choose from {', '.join(terms)}"
        )
    return np.array([float(reward.get(name, 0.0)) for name in terms])
