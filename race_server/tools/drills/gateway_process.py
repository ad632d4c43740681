"""A gateway under a drill: a real one in a separate process."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from race_server.competition.launch import ProcessGroup
from race_server.errors import RaceError
from race_server.logs import last_words


def start_gateway(
    group: ProcessGroup, log: Any, *words: str
) -> tuple[subprocess.Popen[bytes], dict[str, Any]]:
    """Start a gateway on a free port; return its process, and its addresses.

    words: more arguments of ``race gateway``.

    Raises:
        RaceError: it does not start.
    """
    words = ("gateway", "--port", "0", "--recordings", "none", "--json", *words)
    command = [sys.executable, "-m", "race_server", *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log)
    group.aside.append(process)
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        raise RaceError(f"the gateway did not start: {last_words(Path(log.name), 3)}")
    return process, json.loads(line)
