"""Adapters of a real kart: bytes of receivers, beacons and the bus become readings."""
