"""Everything that connects to a running server.

What a newcomer looks for is in:

- `driver`: `KartClient`, a driver in a few lines, and `run_driver`. Below it `seat` (a seat on the
  server), `driver_loop` (each observation and its answer, without I/O), `reconnect` (a new link
  when the old one stalls), `predictor` and `latency_limiter` (latency compensation).
- `spectator`: `Spectator`, standings, snapshots and events of a race. Below it `race_view` (what is
  known of a race, without I/O; the gateway uses it too).
- `steward`: `StewardClient`, the decisions of race control.
- `remote_env`: `RemoteRace`, a PettingZoo environment on a live server; `remote_kart`, one kart.
- `bridge`: two servers, one race: karts of each appear in the other.
- `foxglove`: a live race in Foxglove. `leaderboard`: a race as text in a terminal.

Shared by all: `event_stream` (each event once, in order), `clock_offset` (the age of a message),
`link_stats` (what was received, and how late), `timing` (all timeouts).
"""
