"""What a real kart computes on board, pure: no network, no threads, no clock of its own."""
