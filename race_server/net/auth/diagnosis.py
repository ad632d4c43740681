"""Why a server refuses a client. zenoh cannot say: a refusal looks like silence."""

import socket
import ssl

from race_server.errors import LinkError
from race_server.net.auth.keys import CA, CERTIFICATE, KEY, ClientKeys
from race_server.net.auth.settings import host_of, is_encrypted, port_of

# [s] to wait for a refusal; a server that refuses a certificate sends it at once.
LISTEN_S = 1.0


def explain_refusal(address: str, keys: ClientKeys | None) -> str:
    """Return in a sentence what a plain attempt to connect shows."""
    protocol, _, place = address.partition("/")
    if protocol not in {"tcp", "tls"}:
        return "Is `race serve` running there? A refused login looks the same."
    try:
        link = socket.create_connection((host_of(place), port_of(place)), timeout=LISTEN_S)
    except (OSError, LinkError) as error:
        return (
            f"Nothing listens there ({error}): is `race serve` running, and is the address right?"
        )
    with link:
        if is_encrypted(address) and keys is not None:
            refusal = _refusal(link, host_of(place), keys)
            if refusal:
                return refusal
    if keys is None:
        return (
            "A server listens there but refuses this client: it requires keys (--keys), is full, "
            "or is not a race server."
        )
    return (
        f"A server listens there but refuses {keys.user!r}: the password is wrong or no longer "
        "valid, the keys are of an older session of the same name, or the server is full."
    )


def _refusal(link: socket.socket, host: str, keys: ClientKeys) -> str:
    """Return what fails when both ends exchange certificates, "" for nothing."""
    context = ssl.create_default_context(cafile=str(keys.folder / CA))
    context.load_cert_chain(keys.folder / CERTIFICATE, keys.folder / KEY)
    try:
        with context.wrap_socket(link, server_hostname=host) as encrypted:
            # With TLS 1.3 a refusal of our certificate arrives after our side of the handshake.
            encrypted.settimeout(LISTEN_S)
            encrypted.recv(1)
    except TimeoutError:
        return ""
    except ssl.SSLCertVerificationError as error:
        return (
            f"The server there shows a certificate that these keys do not trust "
            f"({error.verify_message}): it has other keys, or is another server."
        )
    except ssl.SSLError as error:
        return f"The server there refuses our certificate ({error.reason}): it has other keys."
    except OSError:
        return ""
    return ""
