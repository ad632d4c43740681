"""A second simulator behind our own seams: it moves the bodies, and all else stays as it is.

Course, sensors, observations, rules, laps and slots are those of the one world. What another
simulator brings is its motion: under the same controls it says where each body is a tick later.
"""
