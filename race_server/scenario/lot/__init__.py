"""Car parks: slots and goals, what stands in the way, and who walks there."""
