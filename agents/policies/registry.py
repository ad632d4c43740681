"""Find policies: by path, by the folder of a training run, or among the bundled ones."""

from pathlib import Path

from race_server.errors import DriverError
from race_server.user_data import path_named, user_data

# In the folder of a run.
POLICY, CONFIG, EVALUATION, BEST = "policy.onnx", "config.toml", "evaluation.json", "best.pt"
SHIPPED = Path(__file__).parent
MOST_BYTES = 64 * 1024 * 1024


def runs_folder() -> Path:
    """Return the user's folder of training runs."""
    return user_data("runs")


def run_folder(name: str) -> Path:
    """Return the folder of a run: the given one, or that of its name."""
    place = path_named(name)
    return place if place.is_dir() else runs_folder() / name


def policy_path(name: str) -> Path:
    """Return the file of a policy.

    name: a path that ends in ``.onnx``, a folder with a policy, the name of a run, or that of a
    bundled policy.

    Raises:
        DriverError: there is none.
        ScenarioError: it is in the home of no user.
    """
    path = path_named(name)
    if path.suffix == ".onnx":
        if path.is_file():
            return path
        raise DriverError(f"{name}: no such file; give a policy.onnx or the name of a run")
    places = [path / POLICY, runs_folder() / name / POLICY, SHIPPED / f"{name}.onnx"]
    for place in places:
        if place.is_file():
            return place
    known = ", ".join(policy_names()) or "none so far: `race train time-trial` makes one"
    raise DriverError(f"policy {name!r} is unknown; known are {known}; or give an .onnx file")


def name_of(run: Path) -> str:
    """Return the name by which a training run is found: its folder's, or the whole path.

    One of several policies that learned together has that of its run in front, as in `duel-1/red`.
    """
    runs, whole = runs_folder().absolute(), run.absolute()
    return whole.relative_to(runs).as_posix() if whole.is_relative_to(runs) else str(whole)


def policies_of_runs() -> list[Path]:
    """Return the policies of the user's runs, of those that learned together each."""
    runs = runs_folder()
    return sorted(path for depth in ("*", "*/*") for path in runs.glob(f"{depth}/{POLICY}"))


def policy_names() -> list[str]:
    """Return the names of bundled policies and of runs that have one."""
    runs = {name_of(path.parent) for path in policies_of_runs()}
    return sorted(runs | {path.stem for path in SHIPPED.glob("*.onnx")})


def policy_bytes(path: Path) -> bytes:
    """Return the contents of a policy's file.

    Raises:
        DriverError: it cannot be read or is too large.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise DriverError(f"{path}: larger than {MOST_BYTES} bytes: not a policy")
        return path.read_bytes()
    except OSError as error:
        raise DriverError(f"{path}: cannot be read: {error.strerror}") from error
