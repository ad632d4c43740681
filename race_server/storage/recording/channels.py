"""The channels of a recording, and what is written of each message's kind."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

GENERATED = Path(__file__).parents[2] / "net" / "wire" / "generated"
NAMESPACE = "race"


@dataclass(frozen=True)
class ChannelKind:
    """One row: what a channel carries. Its topic is ``race/<session>/<key>``."""

    key: str
    schema: str  # file and table in schemas/, or a well-known JSON schema
    encoding: str = "flatbuffer"

    @property
    def schema_name(self) -> str:
        """Name of the message's type, as readers of MCAP know it."""
        return f"{NAMESPACE}.{self.schema}" if self.encoding == "flatbuffer" else self.schema

    @property
    def schema_encoding(self) -> str:
        """How the schema itself is written."""
        return "flatbuffer" if self.encoding == "flatbuffer" else "jsonschema"

    @property
    def schema_data(self) -> bytes:
        """The schema itself."""
        if self.encoding == "flatbuffer":
            return _binary_schema(self.schema)
        return json.dumps({"type": "object", "title": self.schema}).encode()


@cache
def _binary_schema(name: str) -> bytes:
    return (GENERATED / f"{name}.bfbs").read_bytes()


START = ChannelKind("journal/start", "journal.RaceStart")
INPUTS = ChannelKind("journal/inputs", "journal.Inputs")
PLACEMENTS = ChannelKind("journal/placements", "journal.Placements")
ACTS = ChannelKind("journal/acts", "journal.Acts")
GRANTED = ChannelKind("journal/granted", "journal.Granted")
DIGEST = ChannelKind("journal/digest", "journal.Digest")
LAPS = ChannelKind("laps", "journal.Lap")
SNAPSHOTS = ChannelKind("out/snapshot", "spectate.Snapshot")
EVENTS = ChannelKind("out/events", "spectate.Events")
STANDINGS = ChannelKind("out/standings", "spectate.Standings")
LOTS = ChannelKind("out/lot", "spectate.Lot")
ALERTS = ChannelKind("out/alerts", "spectate.Alerts")
TELEMETRY = ChannelKind("out/telemetry", "spectate.Telemetries")
PROGRAMMES = ChannelKind("out/programme", "spectate.Programme")
GHOSTS = ChannelKind("out/ghosts", "spectate.Ghosts")
# What Foxglove draws, see `scene.py`.
SCENE = ChannelKind("scene", "foxglove.SceneUpdate", "json")

CHANNELS = (
    *(START, INPUTS, PLACEMENTS, ACTS, GRANTED, DIGEST, LAPS),
    *(SNAPSHOTS, EVENTS, STANDINGS, LOTS, ALERTS, TELEMETRY, PROGRAMMES, GHOSTS),
    SCENE,
)
