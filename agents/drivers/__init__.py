"""Drivers: each is found by its name through the entry points `race_server.drivers`."""
