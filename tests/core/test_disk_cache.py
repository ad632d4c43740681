"""Kernels are compiled once, however many processes begin at the same time."""

import os
import subprocess
import sys
from pathlib import Path

CODE = """
import sys
from race_server.core.kernels.geometry import wrap_angle
print("ready", flush=True)
sys.stdin.readline()
wrap_angle(4.0)
print(sum(wrap_angle.entry.stats.cache_misses.values()))
"""


def test_of_three_processes_that_begin_together_one_compiles_and_two_load(tmp_path: Path) -> None:
    env = {**os.environ, "RACE_SERVER_CACHE": str(tmp_path)}
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", CODE],
            env=env,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(3)
    ]
    for process in processes:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    for process in processes:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    assert sorted(int(process.communicate(timeout=60)[0]) for process in processes) == [0, 0, 1]
