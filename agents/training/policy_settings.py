"""Settings of one of several policies that learn in the same races."""

from pydantic import Field

from race_agents.training.settings_table import Table


class PolicySettings(Table):
    """One of several policies that learn in the same races, each with its own karts.

    What is not given is as in the settings of the training.
    """

    name: str = Field(pattern="^[a-z0-9][a-z0-9-]*$")
    karts: int = Field(default=1, ge=1, le=64)
    vehicle: str = ""
    observation: str | tuple[str, ...] = ()
    reward: str | dict[str, float] = Field(default={})
    # Share of a kart's reward that is the mean of those of all karts of its policy.
    team: float = Field(default=0.0, ge=0.0, le=1.0)
