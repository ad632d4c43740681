"""What a real kart knows by itself, for programs on its machine: a screen beside its driver.

It needs no server: where that is silent, place, speed and alerts are still told.
"""

from race_agents.unit.records import Report
from race_server.errors import LinkError
from race_server.net.auth.settings import is_local
from race_server.net.transport import ServerLink
from race_server.net.wire import topics
from race_server.net.wire.alert import AlertFrame, encode_alert
from race_server.net.wire.pose import PoseFrame, encode_pose


class Beside:
    """An address of this machine at which one kart tells what it knows."""

    def __init__(self, address: str, session: str, seat: int) -> None:
        """Listen for programs.

        Raises:
            LinkError: the address is in use, or other machines could reach it.
        """
        if not is_local(address):
            raise LinkError(
                f"{address} can be reached from other machines: what a kart knows is told on its "
                "own machine only; choose an address such as tcp/127.0.0.1:7450"
            )
        self._link = ServerLink(address, session, seat + 1)
        self._seat, self._turns = seat, 0

    def tell(self, report: Report) -> None:
        """Tell what the kart's safety side has reported."""
        self._turns += 1
        alert = AlertFrame(0, self._turns, report.alert)
        self._link.publish(topics.OWN_ALERT, encode_alert(alert), self._seat)
        if report.pose is not None:
            told = encode_pose(PoseFrame(0, self._turns, 0, report.pose))
            self._link.publish(topics.OWN_POSE, told, self._seat)

    def close(self) -> None:
        """Tell no more."""
        self._link.close()
