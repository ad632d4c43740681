"""What the server hears over its link, handed on to whom it concerns."""

from race_server.errors import WireError
from race_server.live.local_drivers import LocalDrivers
from race_server.live.server.counters import Counters
from race_server.live.server.refusals import Refusals
from race_server.live.server.requests import RequestHandler, reason_of
from race_server.net.transport import ServerLink
from race_server.net.wire.drive import decode_control
from race_server.net.wire.pose import decode_pose
from race_server.session import Session


class Inbox:
    """Hears drivers, real karts, and whoever asks for something."""

    def __init__(
        self,
        session: Session,
        link: ServerLink,
        desk: RequestHandler,
        local_drivers: LocalDrivers,
        counters: Counters,
        refused: Refusals,
    ) -> None:
        """Hear a link for a session; what is refused is counted."""
        self._session, self._link = session, link
        self._requests, self._local_drivers = desk, local_drivers
        self._counters, self._refused = counters, refused

    def listen(self) -> None:
        """Take all that has come since the last call."""
        for seat, data in self._link.take_inputs():
            self.take_control(seat, data)
        self._link.hear_karts(self._session.fleet.trackers.keys())
        for seat, data, arrived_us in self._link.take_poses():
            self._take_pose(seat, data, arrived_us)
        for request in self._link.take_requests():
            self._requests.answer(request)
        for seat, is_there in self._link.take_presence():
            if seat not in self._local_drivers:
                self._requests.take_presence(seat, is_there=is_there)

    def take_control(self, seat: int, data: bytes) -> None:
        """Take a control of a seat, if it is one that fits the race."""
        before = self._session.seats[seat].sequence
        try:
            frame = decode_control(data)
            self._session.take_control(seat, frame.epoch, frame.sequence, frame.tick, frame.control)
        except WireError as error:
            self._refused.note(reason_of(error), seat)
        else:
            self._counters.note_control(seat, before, frame.sequence)

    def _take_pose(self, seat: int, data: bytes, arrived_us: int) -> None:
        try:
            frame = decode_pose(data)
            self._session.take_pose(
                seat,
                frame.epoch,
                frame.sequence,
                frame.pose,
                arrived_us=arrived_us,
                acknowledged=frame.acknowledged,
                buttons=frame.buttons,
            )
        except WireError as error:
            self._refused.note(reason_of(error), seat)
