"""What is to be done, and where: a course, karts, rules and sensors made into a world."""
