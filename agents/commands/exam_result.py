"""What `race exam` found of one driver in one scenario, and its row of the JSON document."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from race_server.competition.parking_exam import ExamSpec, Try
    from race_server.competition.parking_rounds import RoundTally
    from race_server.competition.parking_tally import ParkingTally
    from race_server.core.messages import PlannedWay


@dataclass(frozen=True, eq=False)
class Result:
    """One driver in one scenario."""

    driver: str
    spec: "ExamSpec"
    tries: "list[Try]"
    plans: "dict[tuple[int, int], PlannedWay]"  # by seed and vehicle
    tally: "ParkingTally"
    rounds: "RoundTally | None"  # of several vehicles
    hopeless: dict[int, str]  # rounds in which a vehicle could never park, by seed, and why

    def parked_beside_plan(self) -> "list[tuple[Try, PlannedWay]]":
        """Return the tries that were parked, each with its plan."""
        parked = [one for one in self.tries if one.figures["is_success"]]
        keys = [(one.seed, one.vehicle) for one in parked]
        return [
            (one, self.plans[key])
            for one, key in zip(parked, keys, strict=True)
            if key in self.plans
        ]

    def ratios(self, name: str) -> list[float]:
        """Return a figure of each parked vehicle as a multiple of its plan's."""
        return [one.figures[name] / getattr(plan, name) for one, plan in self.parked_beside_plan()]

    def decision_ms(self, share: float) -> float | None:
        """Return the time [ms] in which a share [%] of all answers came."""
        import numpy as np

        times = np.concatenate([one.decisions_ms for one in self.tries])
        return round(float(np.percentile(times, share)), 3) if len(times) else None

    def failed_seeds(self) -> dict[str, list[int]]:
        """Return the seeds of failures by kind."""
        failed = [one for one in self.tries if not one.figures["is_success"]]
        return {
            ending: sorted({one.seed for one in failed if one.figures["ending"] == ending})
            for ending in self.tally.failures
        }

    def row(self) -> dict[str, Any]:
        """Return the row of the JSON document. Its keys are a contract."""
        pairs = self.parked_beside_plan()
        planned = sum(plan.direction_changes for _, plan in pairs)
        driven = sum(one.figures["direction_changes"] for one, _ in pairs)
        return {
            "driver": self.driver,
            "scenario": self.spec.scenario,
            "lot": self.spec.lot,
            "level": self.spec.level_name,
            "vehicles": self.spec.vehicles,
            "delay_s": self.spec.delay_s,
            "noise": self.spec.noise,
            "gap": self.spec.gap.changed(),
            **asdict(self.tally),
            "time_ratio_median": _median(self.ratios("time_s")),
            "path_ratio_median": _median(self.ratios("path_m")),
            "direction_changes_ratio": driven / planned if planned else None,
            "decision_ms_p95": self.decision_ms(95.0),
            "decision_ms_worst": self.decision_ms(100.0),
            "failed_seeds": self.failed_seeds(),
            "hopeless_seeds": sorted(self.hopeless),
            "faults": sorted({one.fault for one in self.tries if one.fault}),
            "rounds": asdict(self.rounds) if self.rounds else None,
        }


def _median(values: Sequence[float]) -> float | None:
    return median(values) if values else None
