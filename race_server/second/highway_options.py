"""What of highway-env is as it comes, and what is as here: one factor at a time."""

from dataclasses import dataclass, fields
from typing import Any, Literal, get_args, get_type_hints

from race_server.errors import ScenarioError

NAME = "highway-env"


@dataclass(frozen=True)
class HighwayOptions:
    """Factors by which motion there differs from ours. As it comes, all are `theirs`."""

    # theirs: wheels that never slip; ours: our own motion, in our own steps.
    tyres: Literal["theirs", "ours"] = "theirs"
    # theirs: a step in 1/15 s; ours: one in a tick.
    steps: Literal["theirs", "ours"] = "theirs"
    # theirs: what is asked for acts at once, up to 5 m/s² and 45°; ours: motor, brakes, drag and
    # steering rate of the vehicle.
    actuators: Literal["theirs", "ours"] = "theirs"

    @classmethod
    def of(cls, text: str) -> "HighwayOptions":
        """Return options from words such as ``steps=ours,actuators=ours``.

        Raises:
            ScenarioError: there is no such option, or it has no such value.
        """
        values: dict[str, Any] = {}
        for word in filter(None, text.split(",")):
            name, _, value = word.partition("=")
            kinds = get_type_hints(cls)
            if name not in kinds or value not in get_args(kinds[name]):
                known = ", ".join(
                    f"{each.name}={'|'.join(get_args(kinds[each.name]))}" for each in fields(cls)
                )
                raise ScenarioError(f"{NAME} knows no option {word!r}; choose from {known}")
            values[name] = value
        options = cls(**values)
        if options.tyres == "ours" and options.steps == "theirs":
            raise ScenarioError(
                f"{NAME}: tyres=ours is our own motion, which has its own steps; add steps=ours"
            )
        return options
