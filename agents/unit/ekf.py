"""Where a real kart is: an extended Kalman filter of all that it senses.

Between readings the kart drives on at constant speeds and turn rate, changed by what the
accelerometer feels; what it may do instead is process noise. Tyres under load slip: the rear axle
slides by its compliance times speed times acceleration across, unless something else is plain
(`see_grip`, `race_agents.unit.tyres`). A chi-square gate refuses improbable readings; after several
refusals in a row the state itself is doubted. `squares` holds the normalised innovation squared
(NIS) of each sensor's last reading, which a test compares with its chi-square distribution.
"""

import math
from dataclasses import replace

import numpy as np

from race_agents.unit.borders import Sighting
from race_agents.unit.corrected import ROUGH, Corrected
from race_agents.unit.motion import (
    BIAS,
    COMPLIANCE,
    DELAY,
    HEADING,
    PLACE,
    SCALE,
    SIZE,
    SLIDE,
    SPEED,
    YAW_RATE,
    Agility,
    Floats,
    X,
    Y,
    acceleration_of,
    antenna_at,
    antenna_jacobian,
    drive_on,
    jacobian_of,
    velocity_jacobian,
    velocity_of,
    wrap,
)

# 95 % of all slides of tyres that hold pass this square; the others are slides.
PLAIN = 3.84
# Fixes are rare: this many take a third of a second, in which a kart can be carried metres away.
MOST_FIXES_REFUSED = 3
# But nothing carries a kart whose accelerometer felt no blow for this long [s]: then rather they
# are wrong, for as long as it takes to slow down.
CALM_S, MOST_REFUSED_CALM = 2.0, 25
# Ranges come from many beacons: only when most are refused for a while is the place doubted. One
# that is believed makes up for this many refused: some fit a wrong place, too.
MOST_RANGES_REFUSED, FORGIVES = 25, 2
# Scans in a row that show the borders elsewhere, until the place is doubted; for how long [s] a
# scan tells whether a fix can be right.
MOST_SCANS_REFUSED, SEEN_S = 10, 0.5
# … and the deviation [m] of the place across a border from which on it may be another one.
# A contradiction leaves no more doubt than this [m].
AMBIGUOUS, DOUBT = 1.5, 1.2
# A range is weighted down beyond this many deviations (Huber 1964), and never used beyond that.
HUBER, FARTHEST = 1.5, 5.0
# A program that is held up for longer than this [s], or whose clock jumps, may be anywhere.
PAUSE_S = 0.25
# … and has lost or won this much speed in each second [m/s²].
BRAKES = 7.0
# A kart that slides keeps its direction for about this time [s].
SLIDE_S = 0.1
# Deviations at the start: wheels' scale, compliance as a share, delay [s].
SCALE_DEVIATION, COMPLIANCE_SHARE, DELAY_DEVIATION = 0.03, 0.2, 0.15
MOST_DELAY_S = 0.6
# Receivers with corrections: 90 to 110 ms as a rule (PX4 EKF2_GPS_DELAY: 110 ms).
USUAL_DELAY_S = 0.1

Snapshot = tuple[Floats, Floats, dict[str, int], float, Sighting | None, float, tuple[float, float]]


class KartFilter(Corrected):
    """The filter. `predict` to the time of a reading, then hand in the reading."""

    def __init__(
        self,
        x: float,
        y: float,
        heading: float,
        *,
        lever: float,
        agility: Agility | None = None,
        compliance: float = 0.0,
        heading_deviation: float | None = None,
        deviation: float = 1.0,
    ) -> None:
        """Begin at rest, the antenna at (x, y); the heading is known to about 20 degrees.

        compliance: slip angle of the rear tyres per acceleration across [s²/m], 0: they roll where
        the body points. heading_deviation: [rad], where it is known better.
        """
        self._lever = lever
        agility = agility or Agility()
        # Tyres that are not said to slip do not soften either.
        agility = agility if compliance else replace(agility, compliance_drift=0.0)
        self._noise = agility.noise(feels=False), agility.noise(feels=True)
        back_x, back_y = x - lever * math.cos(heading), y - lever * math.sin(heading)
        super().__init__()
        self.state[[X, Y, HEADING]] = back_x, back_y, heading
        self.state[[COMPLIANCE, DELAY]] = compliance, USUAL_DELAY_S
        spread = max(1.0, deviation**2)
        rough = ROUGH if heading_deviation is None else heading_deviation**2
        self.covariance = np.diag(
            [
                *(spread, spread, rough, 0.25, 0.25, 2.5e-3, 0.01),
                *(SCALE_DEVIATION**2, (COMPLIANCE_SHARE * compliance) ** 2, DELAY_DEVIATION**2),
            ]
        )
        self.push = 0.0, 0.0  # [m/s²] in the last step
        self._calm_s = 0.0  # since the last blow
        self._seen: Sighting | None = None  # of the borders, the last one
        self._seen_s = 0.0  # ago

    def snapshot(self) -> Snapshot:
        """Return what `restore` brings back; nothing changes these arrays."""
        seen = self._seen, self._seen_s, self.push
        return self.state, self.covariance, self._refused.copy(), self._calm_s, *seen

    def restore(self, snapshot: Snapshot) -> None:
        """Be again what the filter was."""
        self.state, self.covariance, refused, self._calm_s, seen, seen_s, self.push = snapshot
        self._seen, self._seen_s, self._refused = seen, seen_s, refused.copy()

    def predict(
        self, dt: float, *, push: tuple[float, float] | None = None, blow: float = 0.0
    ) -> None:
        """Drive on for `dt` seconds.

        push: accelerations [m/s²] of the speeds ahead and aside, as they were felt; blow: [m/s²]
        that no tyre can have caused. A kart that is hit may move where its body does not point, at
        up to the speed that it had.
        """
        if dt <= 0.0:
            return
        is_calm = push is not None and blow == 0.0 and dt <= PAUSE_S
        self._calm_s = self._calm_s + dt if is_calm else 0.0
        self._seen_s += dt
        slope = jacobian_of(self.state, dt)
        half = (0.5 * dt) * self._noise[push is not None]
        self.push = push or (0.0, 0.0)
        self.state = drive_on(self.state, dt, self.push)
        self.covariance = slope.dot(self.covariance + half).dot(slope.T) + half
        if blow > 0.0:
            speed = abs(float(self.state[SPEED])) + blow * dt
            slid, turned = speed * speed * SLIDE_S * dt, (blow * dt) ** 2
            doubts = np.zeros(SIZE)
            doubts[[X, Y, SPEED]] = slid, slid, turned
            self.covariance = self.covariance + np.diag(doubts)
        if dt > PAUSE_S:
            doubts = np.zeros(SIZE)
            doubts[[X, Y]] = (float(self.state[SPEED]) * dt) ** 2
            doubts[[HEADING, SPEED]] = ROUGH, (BRAKES * dt) ** 2
            self.covariance = self.covariance + np.diag(doubts)

    def see_position(
        self,
        x: float,
        y: float,
        deviation: float,
        *,
        lag: float | None = None,
        jitter: float = 0.0,
    ) -> bool:
        """Take a position fix of this moment; False if it was not believed.

        lag: [s] by which the filter was set back for a fix without a stamp: the delay is then
        learned from where the fix lies along the way, to the second order: a kart that drives off
        was slower then (Bar-Shalom, Li and Kirubarajan 2001, section 10.3). jitter: deviation [s]
        of the stamp.
        """
        residual = np.array([x, y]) - antenna_at(self.state, self._lever)
        slope = antenna_jacobian(self.state, self._lever)
        noise = np.eye(2) * deviation**2
        velocity = velocity_of(self.state, self._lever)
        if lag is not None:
            later, unsure = float(self.state[DELAY]) - lag, float(self.covariance[DELAY, DELAY])
            change = acceleration_of(self.state, self.push, self._lever)
            residual = residual + velocity * later - 0.5 * (later * later + unsure) * change
            slope[:, DELAY] = later * change - velocity
            noise += 0.5 * unsure * unsure * np.outer(change, change)
        if jitter > 0.0:
            noise += jitter**2 * np.outer(velocity, velocity)
        if self._update("position", residual, slope, noise):
            return True
        self._doubt("position", residual, slope, self._most_refused(residual))
        return False

    def _most_refused(self, shift: Floats) -> int | None:
        """Return how many fixes `shift` (2,) [m] from here are refused before one is believed."""
        if self._calm_s <= CALM_S:
            return MOST_FIXES_REFUSED
        seen = self._seen
        is_here = seen is not None and self._seen_s <= SEEN_S and seen.belies(self.state, shift)
        return None if is_here else MOST_REFUSED_CALM

    def see_velocity(self, speed: float, course: float, deviation: float) -> bool:
        """Take speed and course over the ground of the antenna; False if they were not believed."""
        told = np.array([speed * math.cos(course), speed * math.sin(course)])
        residual = told - velocity_of(self.state, self._lever)
        slope = velocity_jacobian(self.state, self._lever)
        if self._update("velocity", residual, slope, np.eye(2) * deviation**2):
            return True
        self._doubt("velocity", residual, slope, MOST_FIXES_REFUSED)
        return False

    def see_range(self, x: float, y: float, distance: float, deviation: float) -> bool:
        """Take a distance to a beacon at (x, y); False if it was not believed.

        Echoes make ranges long: one that is off by more than 1.5 deviations of what is expected
        moves the kart no farther than that one (Huber; Masreliez and Martin 1977: the deviation is
        that of the place, too, or the first echo would carry off a kart that is not sure of its
        place). Beyond 5 it is refused.
        """
        antenna = antenna_at(self.state, self._lever)
        away = antenna - (x, y)
        far = math.hypot(*away)
        if far < deviation:
            return False  # over the beacon a range has no direction
        row = (away / far) @ antenna_jacobian(self.state, self._lever)
        residual = distance - far
        shared = self.covariance.dot(row)
        spread = float(row.dot(shared))
        off = abs(residual) / math.sqrt(spread + deviation**2)
        self.squares["range"] = off * off
        if off > FARTHEST:
            self._doubt("range", np.array([residual]), row[None], MOST_RANGES_REFUSED)
            return False
        self._refused["range"] = max(self._refused.get("range", 0) - FORGIVES, 0)
        weight = min(1.0, HUBER / max(off, 1e-9))
        self._correct(shared, residual, (spread + deviation**2) / weight)
        return True

    def see_borders(self, seen: Sighting) -> bool:
        """Take borders that the radar sees; False if most of them were not believed.

        A kart that may be metres away cannot tell which border it sees: such an echo says nothing.
        """
        rows, residuals = seen.rows(self.state), seen.residuals(self.state)
        variances, place = seen.deviations**2, self.covariance[:PLACE, :PLACE]
        spread = ((rows @ place) * rows).sum(axis=1)
        told = spread < AMBIGUOUS**2
        count = np.count_nonzero(told)
        if 2 * count < len(rows):
            self._seen = None
            return True
        self._seen, self._seen_s = seen, 0.0
        squares = residuals * residuals / (spread + variances)
        self.squares["border"] = float(squares.sum()) / len(rows)
        believed = told & (squares <= FARTHEST**2)
        if 2 * np.count_nonzero(believed) < count:
            doubted = np.zeros((len(rows), SIZE))
            doubted[:, :PLACE] = rows
            doubt = np.clip(residuals, -DOUBT, DOUBT) / math.sqrt(len(rows))
            self._doubt("border", doubt, doubted, MOST_SCANS_REFUSED)
            return False
        self._refused["border"] = 0
        weighed = rows.T * (believed / (variances * np.maximum(np.sqrt(squares) / HUBER, 1.0)))
        known = weighed @ rows
        gain = self.covariance[:, :PLACE] @ np.linalg.inv(np.eye(PLACE) + known @ place)
        self.state = self.state + gain @ (weighed @ residuals)
        self.state[HEADING] = wrap(float(self.state[HEADING]))
        covariance = self.covariance - gain @ known @ self.covariance[:PLACE]
        self.covariance = 0.5 * (covariance + covariance.T)
        return True

    def see_heading(self, heading: float, deviation: float) -> bool:
        """Take the heading of two antennas; False if it was not believed.

        A source of headings that goes wrong for good never turns a good heading over.
        """
        row = _unit_row(HEADING)
        residual = wrap(heading - float(self.state[HEADING]))
        return self._see_one("heading", residual, row, deviation, most=None)

    def see_speed(self, speed: float, deviation: float) -> bool:
        """Take the speed of the wheels; False if it was not believed."""
        scale, own = 1.0 + float(self.state[SCALE]), float(self.state[SPEED])
        row = _unit_row(SPEED) * scale
        row[SCALE] = own
        return self._see_one("wheels", speed - scale * own, row, deviation)

    def see_yaw_rate(self, rate: float, deviation: float) -> bool:
        """Take the gyro's turning rate, bias and all; False if it was not believed."""
        expected = float(self.state[YAW_RATE] + self.state[BIAS])
        row = _unit_row(YAW_RATE)
        row[BIAS] = 1.0
        return self._see_one("gyro", rate - expected, row, deviation)

    def see_grip(self, load: float, smooth: float, deviation: float) -> None:
        """Assume that the tyres hold, unless the kart clearly slides.

        load: acceleration of the rear axle to the left [m/s²], times by how much more than at a
        low load the tyres yield to it; smooth: about the same without the noise of the
        accelerometer, which would make the tyres seem stiffer than they are (errors in
        variables); deviation: of the slide that is expected [m/s].
        """
        compliance, speed = float(self.state[COMPLIANCE]), float(self.state[SPEED])
        row = _unit_row(SLIDE)
        row[COMPLIANCE] = abs(speed) * smooth
        row[SPEED] = math.copysign(compliance, speed) * smooth
        residual = -float(self.state[SLIDE]) - compliance * abs(speed) * load
        shared = self.covariance.dot(row)
        spread = float(row.dot(shared)) + deviation**2
        square = residual**2 / spread
        self.squares["grip"] = square
        if square < PLAIN:
            self._correct(shared, residual, spread)

    def mend_bias(self, off: float, turned: float) -> None:
        """Take it that the gyro tells `off` [rad/s] more than was known.

        turned: [rad] by which the heading may be wrong since.
        """
        state, covariance = self.state.copy(), self.covariance.copy()
        state[[BIAS, YAW_RATE]] += off, -off
        covariance[[BIAS, HEADING], [BIAS, HEADING]] += (0.25 * off) ** 2, turned**2
        self.state, self.covariance = state, covariance

    def see_rest(self) -> None:
        """Take it that the kart stands: no speed, no turn, no slide."""
        for column, deviation in ((SPEED, 0.01), (YAW_RATE, 1e-3), (SLIDE, 0.01)):
            shared = self.covariance[column]
            spread = float(shared[column]) + deviation**2
            self._correct(shared, -float(self.state[column]), spread)

    @property
    def delay_s(self) -> float:
        """Delay of fixes without a stamp [s], as it was learned."""
        return min(max(float(self.state[DELAY]), 0.0), MOST_DELAY_S)

    @property
    def deviation(self) -> float:
        """Standard deviation [m] of the position, in its worse direction at most."""
        return math.sqrt(float(self.covariance[X, X] + self.covariance[Y, Y]))


def _unit_row(column: int) -> Floats:
    row = np.zeros(SIZE)
    row[column] = 1.0
    return row
