"""Where a real kart is, and whether to believe it. Pure: times come in as numbers.

A pose is as old as its message was on its way. The quickest messages give the offset of the kart's
clock, the kart is moved on along an arc from then to now, and a pose that no kart can have reached
is refused: it never gets into the world. While none can be believed the kart stays where
it was last known to be, touches no other kart, and is in the end retired.
"""
