"""Joins the ports of one process to the wire."""

from __future__ import annotations

from typing import Any

import zmq

from sonar_component.middleware.policy import Mailbox, Policy
from sonar_component.middleware.ports import Connection, InputPort, OutputPort
from sonar_component.middleware.schema import Schema
from sonar_component.middleware.transport.loop import Loop
from sonar_component.middleware.transport.publisher import Publisher
from sonar_component.middleware.transport.sockets import publisher_socket, subscriber_socket
from sonar_component.middleware.transport.subscriber import Decoder, Subscriber

_SPARE = 64  # messages that may wait in a subscriber's socket beside those of its policy


class Transport:
    """The sockets of one process and the thread that serves them."""

    def __init__(self) -> None:
        self.context: zmq.Context[Any] = zmq.Context()
        self.loop = Loop()
        self.publishers: dict[str, Publisher] = {}
        self.subscribers: list[Subscriber] = []
        self.loop.start()

    def bind(self, port: OutputPort[Any], endpoints: list[str], clock_name: str = "wall") -> Publisher:
        """Offer an output port on one or more addresses."""
        socket = publisher_socket(self.context, port.queue)
        for endpoint in endpoints:
            socket.bind(endpoint)
        publisher = Publisher(socket, port, clock_name)
        port.carrier = self.publishers[port.full_name] = publisher
        self.loop.add(publisher)
        return publisher

    def connect(
        self, port: InputPort[Any], source: str, endpoint: str, policy: Policy, max_age: float | None = None
    ) -> Subscriber:
        """Read an output port of another process."""
        connection = Connection(source, Mailbox(policy), max_age)
        port.add(connection)
        return self.subscribe(endpoint, connection, port.schema, port.full_name, port.max_bytes)

    def subscribe(
        self, endpoint: str, connection: Connection, decoder: Decoder | Schema, reader: str, max_bytes: int
    ) -> Subscriber:
        """Fill a connection's mailbox from an address."""
        socket = subscriber_socket(self.context, connection.mailbox.policy.size + _SPARE, max_bytes)
        subscriber = Subscriber(socket, connection, decoder, reader)
        socket.connect(endpoint)
        self.subscribers.append(subscriber)
        self.loop.add(subscriber)
        return subscriber

    def close(self) -> None:
        """Close everything; what is on its way has `LINGER_MS` to leave."""
        self.loop.stop()
        for publisher in self.publishers.values():
            publisher.close()
        for subscriber in self.subscribers:
            subscriber.close()
        self.context.term()
