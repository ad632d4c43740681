"""What drivers share: reading a scan, lines and lanes, other karts, delays."""
