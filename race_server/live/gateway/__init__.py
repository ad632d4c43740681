"""The gateway: lets browsers watch, drive and steward a race, from a process of its own."""
