"""The running processes: server, gateway, clients."""
