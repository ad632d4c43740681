"""What all tables of settings have in common."""

from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict

# Logarithms of the deviations of actions: one for all their numbers, or one for each.
Deviations = float | tuple[float, ...]


def _absolute(path: str) -> str:
    return str(Path(path).expanduser().absolute()) if path else ""


# In full, so that the settings in a run's folder mean the same file from anywhere.
File = Annotated[str, AfterValidator(_absolute)]


class Table(BaseModel):
    """A table of settings: it does not change, and knows its keys; all numbers are finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
