"""What outlives the process: recordings and results."""
