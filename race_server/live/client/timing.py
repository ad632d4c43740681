"""How long a client waits for what: one frozen record, passed to whatever waits."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ClientTiming:
    """Timeouts and periods of clients, all in seconds."""

    # Without an observation for this long a driver asks the server for its seat again.
    observation_timeout_s: float = 3.0
    # Without an observation for this long a driver gives up.
    give_up_s: float = 30.0
    # A driver waits at most this long for the event that says how its race ended.
    outcome_s: float = 1.0
    # A new link that does not carry the seat after this long is given up.
    fresh_link_s: float = 5.0
    # Without a message for this long a spectator asks whether the server is still there.
    spectator_timeout_s: float = 3.0
    # `RemoteRace` polls its seats in turn, each for this long.
    poll_s: float = 0.05
    # `RemoteRace` reports ready again at this period: a lobby forgets it with every race.
    ready_s: float = 0.25
    # The event that says why a kart is out arrives close to its last observation.
    final_event_s: float = 1.0


@dataclass(frozen=True)
class BridgeTiming:
    """Periods and timeouts of a bridge between two sites."""

    # Every n-th snapshot is sent on as a pose: 30 poses a second.
    snapshots_per_pose: int = 2
    # A site without a snapshot for this long [s] counts as gone.
    snapshot_timeout_s: float = 10.0
    # Between two polls of the sites [s].
    poll_s: float = 0.004
