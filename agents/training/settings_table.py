"""What all tables of settings have in common."""

from pydantic import BaseModel, ConfigDict


class Table(BaseModel):
    """A table of settings: it does not change, and knows its keys; all numbers are finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
