"""Bytes, sockets and who may use them."""
