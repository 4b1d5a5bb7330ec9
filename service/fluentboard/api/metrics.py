"""Metrics: what the service counts, in the formats that Prometheus reads."""

from __future__ import annotations

import importlib.metadata
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping

from prometheus_client import CollectorRegistry
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    InfoMetricFamily,
)
from prometheus_client.exposition import choose_encoder
from prometheus_client.metrics_core import Metric

from fluentboard.api.exchange import Call, Reply
from fluentboard.api.operations import Answer, Content, Operation

_BUCKETS_S = (0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)


class Metrics:
    """Counts requests, and asks others for what they count when it is read.

    Counting is a few additions on plain lists: the event loop is one thread, so the locks of
    `prometheus_client`'s own counters would only cost time on the hot routes.
    """

    def __init__(self) -> None:
        self._registry = CollectorRegistry(auto_describe=False)
        self._registry.register(self)
        self._requests: dict[tuple[str, int], int] = {}
        self._durations: dict[str, list[float]] = {}
        self._gauges: dict[str, tuple[str, Callable[[], float]]] = {}
        self._counters: dict[str, tuple[str, Callable[[], float]]] = {}

    def record(self, operation: str, status: int, duration_s: float) -> None:
        """Counts one answered request."""
        key = (operation, status)
        self._requests[key] = self._requests.get(key, 0) + 1
        buckets = self._durations.get(operation)
        if buckets is None:
            # One cell per bucket, one for slower ones, and the sum.
            buckets = self._durations[operation] = [0.0] * (len(_BUCKETS_S) + 2)
        buckets[bisect_left(_BUCKETS_S, duration_s)] += 1
        buckets[-1] += duration_s

    def gauge(self, name: str, description: str, read: Callable[[], float]) -> None:
        """Adds a value that goes up and down, read when the metrics are."""
        self._gauges[name] = (description, read)

    def counter(self, name: str, description: str, read: Callable[[], float]) -> None:
        """Adds a value that only grows, read when the metrics are."""
        self._counters[name] = (description, read)

    def collect(self) -> Iterator[Metric]:
        """Everything counted, for the registry."""
        build = InfoMetricFamily("fluentboard", "Version of the service.")
        build.add_metric([], {"version": importlib.metadata.version("fluentboard")})
        yield build
        requests = CounterMetricFamily(
            "fluentboard_http_requests",
            "Requests answered.",
            labels=["operation", "status"],
        )
        for (operation, status), count in self._requests.items():
            requests.add_metric([operation, str(status)], count)
        yield requests
        durations = HistogramMetricFamily(
            "fluentboard_http_request_seconds", "Time to the end of a reply.", labels=["operation"]
        )
        for operation, cells in self._durations.items():
            durations.add_metric([operation], _cumulative(cells), cells[-1])
        yield durations
        for name, (description, read) in self._gauges.items():
            yield GaugeMetricFamily(f"fluentboard_{name}", description, value=read())
        for name, (description, read) in self._counters.items():
            yield CounterMetricFamily(f"fluentboard_{name}", description, value=read())

    def describe(self) -> Iterable[Metric]:
        """Nothing: what is collected is not fixed in advance."""
        return ()

    async def answer(self, call: Call) -> Reply:
        """`GET /metrics`."""
        encode, content_type = choose_encoder(call.header(b"accept") or "")
        return Reply(encode(self._registry), content_type.encode())

    def operations(self) -> list[Operation]:
        """The route that Prometheus scrapes."""
        text: Mapping[str, Content] = {"text/plain": Content({"type": "string"})}
        return [
            Operation(
                "GET",
                "/metrics",
                self.answer,
                "getMetrics",
                "What the service counts, for Prometheus",
                "In the Prometheus text format, or in OpenMetrics if the client accepts that.",
                tag="operation",
                answers={200: Answer("The metrics.", text)},
                is_strict=False,
            )
        ]


def _cumulative(cells: list[float]) -> list[tuple[str, float]]:
    total = 0.0
    buckets: list[tuple[str, float]] = []
    for bound, count in zip((*_BUCKETS_S, float("inf")), cells, strict=False):
        total += count
        buckets.append(("+Inf" if bound == float("inf") else str(bound), total))
    return buckets
