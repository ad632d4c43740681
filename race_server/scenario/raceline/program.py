"""Nonlinear programs over the stations of a closed course, solved by CasADi with IPOPT."""

from typing import Any

import numpy as np

from race_server.errors import RaceError, TrackError
from race_server.scenario.track.course import Floats

# Every path and every lap converges in some tens of iterations; beyond this none fits.
MOST_ITERATIONS = 600
# Where IPOPT stops. ROUGH takes as little as a fifth of the iterations, for laps 0.1 % slower.
EXACT, ROUGH = 1e-6, 1e-4
_OPTIONS: dict[str, Any] = {
    "print_time": False,
    # IPOPT tries points where a root has no value, and takes a shorter step then.
    "show_eval_warnings": False,
}
# Of some hundred courses one is not solved at first, but with a barrier that may rise again.
_STRATEGIES = ("monotone", "adaptive")
_GOOD = ("Solve_Succeeded", "Solved_To_Acceptable_Level")


def load_casadi() -> Any:
    """Return the CasADi package, an extra of this project.

    Raises:
        RaceError: it is not installed.
    """
    try:
        import casadi
    except ImportError as error:
        raise RaceError(
            "the reference limit needs CasADi, which is not installed: "
            "`pip install race-server[mpc]`"
        ) from error
    return casadi


def following(values: Any) -> Any:
    """Return each station's successor's value; the last station is followed by the first."""
    return load_casadi().vertcat(values[1:], values[0])


class Program:
    """Unknowns at N stations of a closed course, equations between them and a cost."""

    def __init__(self, stations: int, step: float) -> None:
        self.stations = stations
        self.step = step  # [m] along the centre line
        self.casadi = load_casadi()
        self._unknowns: list[Any] = []
        self._lows: list[Floats] = []
        self._highs: list[Floats] = []
        self._guesses: list[Floats] = []
        self._terms: list[Any] = []
        self._term_lows: list[float] = []

    def unknown(self, low: Floats | float, high: Floats | float, guess: Floats | float) -> Any:
        """Return N new unknowns (N,) within bounds."""
        self._unknowns.append(self.casadi.SX.sym(f"x{len(self._unknowns)}", self.stations))
        for values, given in (
            (self._lows, low),
            (self._highs, high),
            (self._guesses, np.clip(guess, low, high)),
        ):
            values.append(np.broadcast_to(np.asarray(given, np.float64), (self.stations,)))
        return self._unknowns[-1]

    def evolve(self, state: Any, slope: Any) -> None:
        """Require that a state follow its slope along the course, by the trapezoidal rule."""
        mean = 0.5 * (slope + following(slope))
        self._terms.append(following(state) - state - self.step * mean)
        self._term_lows.append(0.0)

    def keep_zero(self, terms: Any) -> None:
        """Require that terms (N,) be zero."""
        self._terms.append(terms)
        self._term_lows.append(0.0)

    def keep_negative(self, terms: Any) -> None:
        """Require that terms (N,) be zero or less."""
        self._terms.append(terms)
        self._term_lows.append(-np.inf)

    def minimise(self, cost: Any, what: str, tolerance: float = EXACT) -> list[Floats]:
        """Return the unknowns in the order of their making, each (N,), at the least cost.

        Raises:
            TrackError: nothing meets all conditions; `what` names what was asked for.
        """
        problem = {
            "x": self.casadi.vertcat(*self._unknowns),
            "f": cost,
            "g": self.casadi.vertcat(*self._terms),
        }
        ipopt = {"print_level": 0, "sb": "yes", "max_iter": MOST_ITERATIONS, "tol": tolerance}
        for strategy in _STRATEGIES:
            options = {**_OPTIONS, "ipopt": {**ipopt, "mu_strategy": strategy}}
            solver = self.casadi.nlpsol("limit", "ipopt", problem, options)
            found = solver(
                x0=np.concatenate(self._guesses),
                lbx=np.concatenate(self._lows),
                ubx=np.concatenate(self._highs),
                lbg=np.repeat(self._term_lows, self.stations),
                ubg=0.0,
            )
            status = solver.stats()["return_status"]
            if status in _GOOD:
                break
        else:
            raise TrackError(
                f"{what}: no line fits ({status}): bends tighter than the vehicle can steer, or "
                "too narrow for its width and margin; choose a wider course or a smaller vehicle"
            )
        values = np.asarray(found["x"], np.float64).reshape(len(self._unknowns), self.stations)
        return list(values)
