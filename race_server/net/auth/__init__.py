"""Access to the network: keys, access rules, limits, and the zenoh settings made from them."""
