"""Driver training: where a lap was lost, why, and what to try; numbers in, numbers out."""
