"""The life of a race session: lobby, countdown, race, finish. No network, no clock, no files.

Seats and drivers are decided here; what happens on the track is decided by the world. The server
feeds joins, controls and ticks in, and takes events, observations and standings out.
"""
