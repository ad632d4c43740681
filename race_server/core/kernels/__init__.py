"""Motion, contacts, rays and sensors: numbers in, numbers out."""
