"""Figures of a running server for Prometheus, and whether it is well, over HTTP on loopback.

Everything is read when a request comes; the loop does nothing for it.
"""

import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from socketserver import ThreadingMixIn
from typing import Any
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer, make_server

from prometheus_client import CollectorRegistry, ProcessCollector, make_wsgi_app
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)
from prometheus_client.registry import Collector

from race_server.core.clock import TICKS_PER_SECOND
from race_server.errors import LinkError
from race_server.live.server.counters import Histogram
from race_server.live.server.loop import RaceServer

LOOPBACK = "127.0.0.1"
_Answer = Callable[..., Any]


class RaceCollector(Collector):
    """Reads a server's figures; docs/operations.md says what they mean."""

    def __init__(self, server: RaceServer) -> None:
        """Read from this server."""
        self._server = server

    def collect(self) -> Iterable[Metric]:
        """Yield all figures as they are now."""
        yield from self._of_ticks()
        yield from self._of_seats()
        server = self._server
        refused = CounterMetricFamily(
            "race_refused", "Messages refused, by reason.", labels=["reason"]
        )
        for reason, count in server.refusals().items():
            refused.add_metric([reason], count)
        yield refused
        yield _gauge("race_clients", "Links that are open.", server.link.clients())
        yield _gauge(
            "race_recorder_backlog", "Messages that wait for the disk.", server.recorder_backlog()
        )
        yield _gauge(
            "race_phase", "0 lobby, 1 countdown, 2 running, 3 finished.", int(server.session.phase)
        )
        yield _gauge("race_epoch", "Races begun so far.", server.session.epoch)

    def _of_ticks(self) -> Iterator[Metric]:
        counters = self._server.counters
        yield _counter("race_ticks", "Ticks of the world.", counters.ticks)
        yield _counter(
            "race_ticks_missed", "Ticks that came too late and fell out.", counters.missed
        )
        yield _histogram("race_tick_duration_seconds", "Work of a tick.", counters.duration)
        yield _histogram(
            "race_tick_lateness_seconds", "How late a tick began after its time.", counters.lateness
        )

    def _of_seats(self) -> Iterator[Metric]:
        session, counted = self._server.session, self._server.counters
        age = GaugeMetricFamily(
            "race_input_age_seconds", "Since a driver was last heard.", labels=["seat"]
        )
        counters = {
            "race_inputs": ("Controls taken.", counted.controls, 1.0),
            "race_inputs_lost": ("Controls sent that never arrived.", counted.lost, 1.0),
            "race_silent_seconds": (
                "Time in which a kart had no fresh control.",
                counted.silent,
                1.0 / TICKS_PER_SECOND,
            ),
        }
        families = {
            name: CounterMetricFamily(name, words, labels=["seat"])
            for name, (words, _, _) in counters.items()
        }
        races = session.is_on
        for seat in list(session.seats):
            if not seat.is_taken:
                continue
            label = [str(seat.number)]
            if races and seat.control_tick >= 0:
                age.add_metric(label, (session.tick - seat.control_tick) / TICKS_PER_SECOND)
            for name, (_, values, scale) in counters.items():
                families[name].add_metric(label, values[seat.number] * scale)
        yield age
        yield from families.values()


def _gauge(name: str, words: str, value: float) -> Metric:
    return GaugeMetricFamily(name, words, value=value)


def _counter(name: str, words: str, value: float) -> Metric:
    return CounterMetricFamily(name, words, value=value)


def _histogram(name: str, words: str, histogram: Histogram) -> Metric:
    ends = [*(f"{end:g}" for end in histogram.ends), "+Inf"]
    buckets, so_far = [], 0
    for end, count in zip(ends, list(histogram.counts), strict=True):
        so_far += count
        buckets.append((end, float(so_far)))
    return HistogramMetricFamily(name, words, buckets=buckets, sum_value=histogram.total)


def answer_of(server: RaceServer) -> _Answer:
    """Return the WSGI application: ``/metrics`` and ``/healthz``."""
    registry = CollectorRegistry()
    registry.register(RaceCollector(server))
    ProcessCollector(registry=registry)
    metrics = make_wsgi_app(registry)

    def answer(environ: dict[str, Any], start_response: _Answer) -> Iterable[bytes]:
        path = environ.get("PATH_INFO", "")
        if path == "/metrics":
            return metrics(environ, start_response)
        if path == "/healthz":
            reason = server.counters.stillness(server.timing.still_s)
            status, text = "200 OK", "ok"
            if reason:
                status, text = "503 Service Unavailable", reason + server.watchdog.outlook
        else:
            status, text = "404 Not Found", "there are /metrics and /healthz"
        start_response(status, [("Content-Type", "text/plain; charset=utf-8")])
        return [f"{text}\n".encode()]

    return answer


class _Server(ThreadingMixIn, WSGIServer):
    daemon_threads = True


class _Handler(WSGIRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: nothing is logged for each message."""


@contextmanager
def exposed(server: RaceServer, port: int) -> Iterator[int]:
    """Answer on loopback while the block lasts; yields the port.

    port: 0 for any that is free.

    Raises:
        LinkError: it is in use.
    """
    try:
        http = make_server(LOOPBACK, port, answer_of(server), _Server, _Handler)
    except OSError as error:
        raise LinkError(
            f"metrics cannot be shown on port {port} ({error.strerror or error}); choose another "
            "with --metrics PORT, or 0 for any that is free"
        ) from error
    thread = threading.Thread(target=http.serve_forever, name="metrics", daemon=True)
    thread.start()
    try:
        yield int(http.server_port)
    finally:
        http.shutdown()
        http.server_close()
        thread.join()
