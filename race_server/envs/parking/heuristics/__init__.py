"""How far a vehicle still has to drive to its slot: heuristics, one file each.

A module of this folder holds a `HEURISTIC` and the kernel `way`; a line in `table.py` gives it a
number and calls it. Rewards and learners read what it says, see
`race_server/envs/parking/reward_terms.py`.
"""
