"""The example drivers join a race through its gateway and come home; skipped without tools."""

import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from race_server.competition.launch import free_address
from race_server.core.messages import Status
from race_server.live.gateway.roles import Tokens
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.raceline.attach import with_line
from race_server.scenario.track.load import load_course
from support.served_race import ServedRace, gated, racing, wait_for_race

pytestmark = [pytest.mark.live, pytest.mark.slow]

EXAMPLES = Path(__file__).parents[2] / "examples"
TOKEN = "drive-one"


def build_js(place: Path) -> list[str]:
    example = EXAMPLES / "driver_js"
    if shutil.which("npm") is None:
        pytest.skip("Node and npm are not installed")
    if not (example / "node_modules").is_dir():
        pytest.skip("the packages of examples/driver_js are not installed: `npm ci` there")
    program = place / "driver.cjs"
    build = ["npm", "run", "--silent", "build", "--", f"--outfile={program}"]
    subprocess.run(build, cwd=example, check=True)
    return ["node", str(program)]


def build_cpp(place: Path) -> list[str]:
    if shutil.which("cmake") is None:
        pytest.skip("cmake is not installed")
    # Debug is quick to build.
    configure = ["cmake", "-S", str(EXAMPLES / "driver_cpp"), "-B", str(place)]
    configure.append("-DCMAKE_BUILD_TYPE=Debug")
    found = subprocess.run(configure, capture_output=True, text=True, check=False)
    if re.search("Boost|FLAT", found.stderr):
        pytest.skip("Boost or FlatBuffers is not installed: see examples/driver_cpp/README.md")
    assert found.returncode == 0, found.stderr
    subprocess.run(["cmake", "--build", str(place)], capture_output=True, check=True)
    return [str(place / "driver")]


@pytest.fixture(scope="module", params=[build_js, build_cpp], ids=["js", "cpp"])
def program(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Build a driver, and return the command that starts it."""
    command: list[str] = request.param(tmp_path_factory.mktemp("driver"))
    return command


@pytest.fixture
def served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ServedRace]:
    """A race of one lap that waits for a driver, and a gateway."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    rules = Rules(laps=1, countdown_s=0.3)
    scenario = with_line(Scenario(load_course("oval"), karts=1, seed=7, rules=rules))
    address = free_address()
    tokens = Tokens(drive=(TOKEN,))
    with (
        racing(address, drivers=1, scenario=scenario) as server,
        gated(address, tokens=tokens) as served,
    ):
        served.server = server
        wait_for_race(served)
        yield served


def drive(program: list[str], *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*program, *words], capture_output=True, text=True, check=False, timeout=60.0
    )


def test_a_driver_comes_home_and_tells_its_lap(program: list[str], served: ServedRace) -> None:
    done = drive(program, f"{served.base}#drive&token={TOKEN}")
    assert (done.returncode, done.stderr) == (0, "")
    assert served.server is not None
    (row,) = served.server.session.standings()
    assert row.status is Status.FINISHED
    assert row.penalties == 0
    lap = f"{1e-6 * row.lap_times_us[0]:.3f} s"
    assert f"lap 1: {lap}\n" in done.stdout
    assert f"finished in {lap}, place 1 of 1" in done.stdout
    # From a standing start; 8.5 s where nothing else keeps the machine busy.
    assert row.lap_times_us[0] < 12e6


def test_a_driver_says_plainly_why_it_does_not_drive(
    program: list[str], served: ServedRace
) -> None:
    refused = drive(program, f"{served.base}#drive&token=wrong")
    assert refused.returncode == 2
    assert "refused: the token does not fit the role drive" in refused.stderr
    cut_short = drive(program, f"{served.base}#drive")  # what a shell makes of it without quotes
    assert cut_short.returncode == 2
    assert "in quotes" in cut_short.stderr


def test_a_name_may_hold_quotation_marks(program: list[str], served: ServedRace) -> None:
    done = drive(program, f"{served.base}#drive&token=wrong", 'Ada "the \\\\" Swift')
    assert "the token does not fit" in done.stderr
