"""What is left of a race."""

from dataclasses import asdict, dataclass, field
from typing import Any

from race_server.core.messages import Event, Standing


@dataclass(frozen=True)
class RaceResult:
    """What is left of a race."""

    digest: str
    ticks: int
    standings: list[Standing]
    events: list[Event]
    missed_ticks: int
    refused: dict[str, int]
    tracked: list[dict[str, Any]] = field(default_factory=list)  # links of real karts

    def as_json(self) -> dict[str, Any]:
        """Return the result as plain data: the document that `--json` prints."""
        karts = []
        for row in self.standings:
            kart = asdict(row)
            kart["lap_times_us"] = list(row.lap_times_us)
            kart["status"] = row.status.name.lower()
            karts.append(kart)
        return {
            "digest": self.digest,
            "ticks": self.ticks,
            "karts": karts,
            "events": [{**asdict(event), "kind": event.kind.name.lower()} for event in self.events],
            "missed_ticks": self.missed_ticks,
            "refused": self.refused,
            "tracked": self.tracked,
        }
