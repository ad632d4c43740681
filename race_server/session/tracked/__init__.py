"""Where a real kart is, and whether to believe it. Pure: times come in as numbers.

A pose is as old as it took to get here. The kart's clock is set against ours by the quickest
messages, the kart is moved on along an arc from then to now, and what no kart can have done is
refused: a refused pose never gets into the world. While none can be believed the kart stays where
it was last known to be, touches no other kart, and is in the end retired.
"""
