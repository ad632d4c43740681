"""How the server recognises a driver's connection.

A driver draws a secret and shows it when it asks for its seat. Beside its controls and in its
liveliness token it shows the *badge*, which follows from the secret but does not give it away. The
server keeps the *key*, which follows from the badge: it may be stored, because with the key alone
a client can neither take the seat nor drive.
"""

import hashlib


def badge_of(secret: int) -> str:
    """Return what a driver shows with whatever it sends: 32 hexadecimal digits."""
    return hashlib.blake2b(secret.to_bytes(8, "little"), digest_size=16).hexdigest()


def key_of(secret: int) -> bytes:
    """Return the digest by which the server knows a secret."""
    return key_of_badge(badge_of(secret).encode())


def key_of_badge(badge: bytes) -> bytes:
    """Return the digest by which the server knows a badge."""
    return hashlib.blake2b(badge, digest_size=16).digest()
