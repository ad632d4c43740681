"""Who may do what on the network: keys, access rules, limits, and zenoh's settings made of them."""
