"""The program of a real kart: estimation, safety, control unit, network."""
