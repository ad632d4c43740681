"""What the server receives over its link, dispatched to what it concerns."""

from race_server.core.alert import DangerStage
from race_server.errors import Reason, WireError
from race_server.live.local_drivers import LocalDrivers
from race_server.live.server.counters import Counters
from race_server.live.server.requests import RequestHandler
from race_server.net.transport import ServerLink
from race_server.net.wire import topics
from race_server.net.wire.alert import decode_alert
from race_server.net.wire.drive import decode_control
from race_server.net.wire.pose import decode_pose
from race_server.net.wire.telemetry import decode_telemetry
from race_server.session.session import Session


class Inbox:
    """Receives controls, poses, requests and the presence of drivers."""

    def __init__(
        self,
        session: Session,
        link: ServerLink,
        requests: RequestHandler,
        local_drivers: LocalDrivers,
        counters: Counters,
    ) -> None:
        """Receive from a link for a session; what is refused is counted."""
        self._session, self._link, self._requests = session, link, requests
        self._local_drivers, self._counters = local_drivers, counters

    def drain(self) -> None:
        """Receive all that has come since the last call."""
        self._requests.shut_revoked(self._local_drivers)
        for seat, data in self._link.receive_controls():
            self.receive_control(seat, data)
        self._link.expect_tracked(self._session.tracked_karts.trackers.keys())
        for seat, data, arrived_us in self._link.receive_tracked(topics.POSE):
            self._receive_pose(seat, data, arrived_us)
        for seat, data, arrived_us in self._link.receive_tracked(topics.ALERT):
            self._receive_alert(seat, data, arrived_us)
        for seat, data, arrived_us in self._link.receive_tracked(topics.TELEMETRY):
            self._receive_telemetry(seat, data, arrived_us)
        for request in self._link.receive_requests():
            self._requests.answer(request)
        for seat, is_there in self._link.receive_presence():
            if seat not in self._local_drivers:
                self._requests.receive_presence(seat, is_there=is_there)

    def receive_control(self, seat: int, data: bytes) -> None:
        """Receive a control message of a seat, from the link or from a local driver.

        One that is damaged or does not fit the race is counted and dropped.
        """
        before = self._session.seats[seat].sequence
        try:
            frame = decode_control(data)
            self._session.receive_control(
                seat, frame.epoch, frame.sequence, frame.tick, frame.control
            )
        except WireError as error:
            self._counters.refused.record(error.reason, seat)
        else:
            self._counters.record_control(seat, before, frame.sequence)

    def _receive_pose(self, seat: int, data: bytes, arrived_us: int) -> None:
        try:
            frame = decode_pose(data)
            self._session.receive_pose(
                seat,
                frame.epoch,
                frame.sequence,
                frame.pose,
                arrived_us=arrived_us,
                acknowledged=frame.acknowledged,
                buttons=frame.buttons,
            )
        except WireError as error:
            self._counters.refused.record(error.reason, seat)

    def _receive_alert(self, seat: int, data: bytes, arrived_us: int) -> None:
        try:
            frame = decode_alert(data)
            self._check_epoch(frame.epoch)
            alerts = self._session.tracked_karts.alerts
            says_something = frame.alert.danger.stage > DangerStage.NONE
            alert = frame.alert if says_something else None
            alerts.receive(seat, frame.sequence, alert, arrived_us)
        except WireError as error:
            self._counters.refused.record(error.reason, seat)

    def _receive_telemetry(self, seat: int, data: bytes, arrived_us: int) -> None:
        try:
            frame = decode_telemetry(data)
            self._check_epoch(frame.epoch)
            telemetry = self._session.tracked_karts.telemetry
            telemetry.receive(seat, frame.sequence, frame.telemetry, arrived_us)
        except WireError as error:
            self._counters.refused.record(error.reason, seat)

    def _check_epoch(self, epoch: int) -> None:
        if epoch != (now := self._session.epoch):
            raise WireError(f"message for epoch {epoch}, this is epoch {now}", Reason.EPOCH)
