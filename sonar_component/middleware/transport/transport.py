"""Joins the ports of one process to the wire."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import zmq

from sonar_component.middleware.policy import Mailbox, Policy
from sonar_component.middleware.ports import Connection, InputPort, OutputPort
from sonar_component.middleware.schema import Schema
from sonar_component.middleware.transport.keys import Guard
from sonar_component.middleware.transport.loop import Loop
from sonar_component.middleware.transport.monitor import FAILED, Monitor
from sonar_component.middleware.transport.publisher import Publisher
from sonar_component.middleware.transport.sockets import (
    MAX_HANDSHAKE_BYTES,
    Socket,
    bind,
    publisher_socket,
    reliable_socket,
    subscriber_socket,
)
from sonar_component.middleware.transport.subscriber import Decoder, Subscriber

Join = Callable[[Socket], None]
_AGAIN = 0.25  # [s], between two tries of ours to connect
_TERM = 1.0  # [s], above LINGER_MS
_SPARE = 64  # messages that may wait in a subscriber's socket beside those of its policy


class Transport:
    """The sockets of one process and the thread that serves them."""

    def __init__(self) -> None:
        self.context: zmq.Context[Any] = zmq.Context()
        self.loop = Loop()
        self.publishers: dict[str, Publisher] = {}
        self.subscribers: list[Subscriber] = []
        self.monitors: list[Monitor] = []
        self._watching: dict[Subscriber, Monitor] = {}
        self.loop.start()

    def bind(self, port: OutputPort[Any], endpoints: list[str], clock_name: str = "wall") -> Publisher:
        """Offer an output port on one or more addresses."""
        socket = publisher_socket(self.context, port.queue)
        for endpoint in endpoints:
            bind(socket, endpoint)
        publisher = Publisher(socket, port, clock_name)
        port.carrier = self.publishers[port.full_name] = publisher
        self.loop.add(publisher)
        return publisher

    def bind_reliable(self, port: OutputPort[Any], endpoint: str) -> None:
        """Offer a bound port once more, to one reader that must not lose anything.

        Each has a socket of its own: libzmq's NODROP blocks a whole socket, and one reader that stands still must not
        keep samples from another.
        """
        socket = reliable_socket(self.context, 1)  # what waits, waits at the reader
        bind(socket, endpoint)
        outlet = Publisher(socket, port, self.publishers[port.full_name].clock_name)
        self._add_outlet(port, outlet, endpoint)

    def release(self, port: str, endpoint: str) -> None:
        """Close what `bind_reliable` opened; in the loop's thread."""
        outlet = self.publishers.pop(endpoint)
        self.publishers[port].remove(outlet)
        self.loop.remove(outlet)
        outlet.close()

    def bind_remote(self, port: OutputPort[Any], endpoint: str, clock_name: str, guard: Guard | None) -> None:
        """Offer a bound port to other hosts: with a socket of its own, since CURVE holds for a whole socket."""
        socket = publisher_socket(self.context, port.queue, MAX_HANDSHAKE_BYTES)
        if guard is not None:
            guard.serve(socket)
        bind(socket, endpoint)
        outlet = Publisher(socket, port, clock_name)
        self._add_outlet(port, outlet, endpoint)
        self._watch(Monitor(socket, FAILED, outlet.rejected.add))

    def _add_outlet(self, port: OutputPort[Any], outlet: Publisher, endpoint: str) -> None:
        self.publishers[endpoint] = outlet
        self.publishers[port.full_name].add(outlet)
        self.loop.add(outlet)

    def connect(
        self,
        port: InputPort[Any],
        source: str,
        endpoint: str,
        policy: Policy,
        max_age: float | None = None,
        join: Join | None = None,
    ) -> Subscriber:
        """Read an output port of another process; `join` shows our key where it is on another host."""
        connection = Connection(source, Mailbox(policy), max_age)
        port.add(connection)
        return self.subscribe(endpoint, connection, port.schema, port.full_name, port.max_bytes, join)

    def subscribe(
        self,
        endpoint: str,
        connection: Connection,
        decoder: Decoder | Schema,
        reader: str,
        max_bytes: int,
        join: Join | None = None,
    ) -> Subscriber:
        """Fill a connection's mailbox from an address."""
        policy = connection.mailbox.policy
        reliable = policy.kind == "reliable"
        socket = subscriber_socket(self.context, policy.size + (0 if reliable else _SPARE), max_bytes)
        if join is not None:
            join(socket)
        subscriber = Subscriber(socket, connection, decoder, reader)
        if reliable:
            connection.mailbox.on_room = lambda: self.loop.call(subscriber.serve)
        subscriber.connect(endpoint)
        self.subscribers.append(subscriber)
        self.loop.add(subscriber)

        def again(peer: str, reason: str) -> None:
            if subscriber.disconnected():  # the first sign of it; libzmq's own try may come first
                self.loop.after(_AGAIN, lambda: subscriber.connect(endpoint))

        self._watching[subscriber] = self._watch(Monitor(socket, zmq.EVENT_DISCONNECTED, again))
        return subscriber

    def disconnect(self, subscriber: Subscriber) -> None:
        """Read no more from an address; in the loop's thread."""
        monitor = self._watching.pop(subscriber)
        self.monitors.remove(monitor)
        self.subscribers.remove(subscriber)
        self.loop.remove(monitor)
        monitor.close()
        self.loop.remove(subscriber)
        subscriber.close()

    def _watch(self, monitor: Monitor) -> Monitor:
        self.monitors.append(monitor)
        self.loop.add(monitor)
        return monitor

    def close(self) -> None:
        """Close everything; what is on its way has `LINGER_MS` to leave."""
        self.loop.stop()
        for monitor in self.monitors:
            monitor.close()
        for publisher in self.publishers.values():
            publisher.close()
        for subscriber in self.subscribers:
            subscriber.close()
        end = threading.Thread(target=self.context.term, daemon=True)  # it waits for ever for a socket left open
        end.start()
        end.join(_TERM)
