"""What a Ping360-compatible scanning sonar does with messages and time, without I/O.

Registers, limits and answers: ping360_messages.py. Silence on what it does not know, a negative answer with a text on
settings out of range, both as the maker's parser and open firmware do.

Time. A ping lasts ``number_of_samples * sample_period * 25 ns`` plus an overhead in which the device steps its motor by
one gradian and sends the reply; a longer way adds the time of its further steps. The next ping begins when the reply of
the last one has left, so that no client ever sees an interval shorter than the model's. Absolute deadlines lost: they
keep the mean rate better by 1 %, and deliver some replies early with respect to the one before.

Angles. 400 gradians to a turn, clockwise seen from above; the device's own zero looks back, and its maker's viewer
draws it so. ``zero_bearing`` says where zero looks in the sonar's frame.
"""

from __future__ import annotations

import math
from collections import OrderedDict, deque
from dataclasses import dataclass, replace

import numpy as np

from sonar_component.devices import ping360_messages as msg
from sonar_component.devices.echoes import PingOrder
from sonar_component.devices.link import Arrival, Kind, Outgoing, Peer
from sonar_component.devices.ping_protocol import LineBreak, PingFrame, PingParser
from sonar_component.samples import Sonar
from sonar_component.sonars.scanning_settings import ScanningSettings

GAINS = (0.25, 0.5, 1.0)  # [-], the sonar's gain (0.5 is unity) for the device's low, normal and high
_DEVICE_TYPE = 2
_QUEUE = 256  # [-], pings that clients may ask for ahead
_PEERS = 16  # [-], clients whose half frames are remembered
_SETTERS = (msg.SetDeviceId.message_id, msg.Transducer.message_id, msg.AutoTransmit.message_id)
_AT_POWER_UP = msg.Transducer(
    mode=1, gain_setting=0, angle=0, transmit_duration=32, sample_period=80, transmit_frequency=740,
    number_of_samples=1024, transmit=0,
)  # fmt: skip


_Command = msg.Transducer | msg.AutoTransmit


@dataclass(frozen=True)
class _Work:
    """What a ping or a turn is for: the command, the registers in force meanwhile, and who asked."""

    command: _Command
    registers: msg.Transducer
    peer: Peer


@dataclass(frozen=True)
class Ping360Timing:
    """Times that the protocol does not tell.

    Attributes
    ----------
    overhead : float
        Of each ping beside its samples [s]. The product sheet's 9 s a turn at 2 m and 35 s at 50 m leave 20 ms.
    motor_step : float
        Of each gradian beyond the first [s]: the maker's viewer reckons with 2.4 s a turn.
    """

    overhead: float = 20e-3
    motor_step: float = 6e-3


class Ping360Head:
    """Register state, scan and answers.

    Parameters
    ----------
    sonar : ScanningSettings
        Everything that clients do not set: opening of the beam, water, picture.
    firmware : (int, int, int)
        Version to report: clients choose between auto transmit (above 3.3.0) and single pings by it.
    zero_bearing : float
        Where angle 0 looks in the sonar's frame, left positive [rad].
    """

    def __init__(
        self,
        sonar: ScanningSettings,
        timing: Ping360Timing | None = None,
        firmware: tuple[int, int, int] = (3, 3, 8),
        device_id: int = 2,
        zero_bearing: float = math.pi,
    ) -> None:
        self._sonar, self._timing = sonar, timing or Ping360Timing()
        self._firmware, self._own_id, self._zero = firmware, device_id, zero_bearing
        self._parsers: OrderedDict[Peer, PingParser] = OrderedDict()
        self.order: PingOrder | None = None
        self._reset()

    def _reset(self) -> None:
        self.registers = _AT_POWER_UP
        self.device_id = self._own_id
        self._scan: msg.AutoTransmit | None = None
        self._scan_peer: Peer | None = None
        self._scan_begun, self._forwards = False, True
        self._queue: deque[tuple[msg.Transducer, Peer]] = deque()
        self._position = 0
        self._turn: tuple[float, _Work] | None = None  # until when, and what for
        self._settings: ScanningSettings | None = None
        self.order = None

    def settings(self) -> ScanningSettings:
        """Settings of the sonar for the registers in force; the same object until one changes."""
        if self._settings is None:
            r, s = self.registers, self._sonar
            water = s.attenuation_properties.model_copy(update={"frequency": r.transmit_frequency * 1e3})
            self._settings = s.model_copy(
                update={
                    "range": r.number_of_samples * r.sample_period * msg.TICK * s.speed_of_sound / 2,
                    "bin_count": r.number_of_samples, "gain": GAINS[r.gain_setting], "attenuation_properties": water,
                }
            )  # fmt: skip
        return self._settings

    def receive(self, arrival: Arrival, now: float) -> list[Outgoing]:
        """Bytes from a client, or a line break."""
        if arrival.kind is Kind.CLOSED:
            return []
        parser = self._parser(arrival.peer)
        if arrival.kind in (Kind.BREAK, Kind.OPENED):
            parser.reset()  # clients open a serial line with a break, of which a pseudo-terminal shows the opening only
        if arrival.kind is Kind.BREAK:
            self._stop_scan()
        found: list[Outgoing] = []
        for event in parser.feed(arrival.data):
            if isinstance(event, PingFrame):
                found += [(arrival.peer, data) for data in self._answer(event, arrival.peer, now)]
            elif isinstance(event, LineBreak) and arrival.peer.address is None:
                # Only a serial line, which has one nameless client, has to be told its baud rate.
                self._stop_scan()
        return found

    def begin(self, now: float) -> PingOrder | None:
        """Begin the next single ping or the next of the scan."""
        if self.order is not None or self._turn is not None:
            return None
        if self._queue:
            command, peer = self._queue.popleft()
            self._apply(command)
            if command.transmit:
                self._ping(command, command.angle, 0.0, peer, now)
            else:
                self._turn = (now + self._way(command.angle) * self._timing.motor_step, self._work(command, peer))
                self._position = command.angle
        elif self._scan is not None and self._scan_peer is not None:
            scan = self._scan
            angle = self._next_angle(scan)
            self._apply(msg.Transducer(*_settings_of(scan)[:2], angle, *_settings_of(scan)[2:], 1))
            self._ping(scan, angle, scan.delay * 1e-3, self._scan_peer, now)
        return self.order

    def finish(self, sample: Sonar, now: float) -> list[Outgoing]:
        """The reply with its echoes, 0 to 255 for 0 to full scale."""
        assert self.order is not None
        work: _Work = self.order.note
        self.order = None
        data = np.rint(sample.bins[0] * 255).astype(np.uint8).tobytes()
        if isinstance(work.command, msg.Transducer):
            return [(work.peer, _data(work.registers, data).frame(self.device_id))]
        # A scan goes on for whoever spoke last.
        return [(self._scan_peer or work.peer, _auto_data(work.command, work.registers, data).frame(self.device_id))]

    def tick(self, now: float) -> list[Outgoing]:
        """The reply without echoes to a client that only wanted a turn, once the head is there."""
        if self._turn is None or now < self._turn[0]:
            return []
        work, self._turn = self._turn[1], None
        return [(work.peer, _data(work.registers, b"").frame(self.device_id))]

    def next_tick(self) -> float:
        """When a turn without a ping ends."""
        return math.inf if self._turn is None else self._turn[0]

    def _parser(self, peer: Peer) -> PingParser:
        parser = self._parsers.setdefault(peer, PingParser())
        self._parsers.move_to_end(peer)
        while len(self._parsers) > _PEERS:
            self._parsers.popitem(last=False)
        return parser

    def _answer(self, frame: PingFrame, peer: Peer, now: float) -> list[bytes]:
        kind = msg.MESSAGES.get(frame.message_id)
        if kind is None:
            return []
        try:
            message = kind.parse(frame.payload)
        except ValueError as error:
            return [self._nack(frame.message_id, str(error))] if frame.message_id in _SETTERS else []
        reason = msg.out_of_range(message) if frame.message_id in _SETTERS else ""
        if reason:
            return [self._nack(frame.message_id, reason)]
        if self._scan is not None:
            self._scan_peer = peer  # the latest sender is the one that listens
        return self._obey(message, peer)

    def _nack(self, message_id: int, reason: str) -> bytes:
        return msg.Nack(message_id, reason.encode("ascii", "replace")).frame(self.device_id)

    def _obey(self, message: msg.Message, peer: Peer) -> list[bytes]:
        reply: msg.Message | None = None
        if isinstance(message, msg.GeneralRequest):
            reply = self._requested(message.requested_id)
        elif isinstance(message, msg.Transducer):
            self._stop_scan()
            if len(self._queue) < _QUEUE:
                self._queue.append((message, peer))
        elif isinstance(message, msg.AutoTransmit):
            self._stop_scan()
            self._scan, self._scan_peer, self._scan_begun, self._forwards = message, peer, False, True
        elif isinstance(message, msg.MotorOff):
            self._stop_scan()
            reply = msg.Ack(msg.MotorOff.message_id)
        elif isinstance(message, msg.SetDeviceId):
            self.device_id = message.device_id
            reply = msg.Ack(msg.SetDeviceId.message_id)
        elif isinstance(message, msg.Reset):
            self._reset()
        return [] if reply is None else [reply.frame(self.device_id)]

    def _requested(self, message_id: int) -> msg.Message | None:
        r = self.registers
        scan = self._scan or msg.AutoTransmit(*_settings_of(r), 0, msg.TURN - 1, 1, 0)
        answers: dict[int, msg.Message] = {
            msg.DeviceInformation.message_id: msg.DeviceInformation(_DEVICE_TYPE, 1, *self._firmware),
            msg.ProtocolVersion.message_id: msg.ProtocolVersion(1, 0, 0),
            msg.DeviceData.message_id: _data(r, b""),
            msg.AutoDeviceData.message_id: _auto_data(scan, r, b""),
        }
        return answers.get(message_id)

    def _stop_scan(self) -> None:
        self._scan = None
        if self.order is not None and isinstance(self.order.note.command, msg.AutoTransmit):
            self.order = None

    def _apply(self, command: msg.Transducer) -> None:
        if replace(command, angle=0, transmit=0) != replace(self.registers, angle=0, transmit=0):
            self._settings = None
        self.registers = command

    def _ping_time(self) -> float:
        r = self.registers
        return r.number_of_samples * r.sample_period * msg.TICK + self._timing.overhead

    def _work(self, command: _Command, peer: Peer) -> _Work:
        return _Work(command, self.registers, peer)

    def _way(self, angle: int) -> int:
        """Gradians to turn, the shorter way round."""
        return abs((angle - self._position + msg.TURN // 2) % msg.TURN - msg.TURN // 2)

    def _ping(self, command: _Command, angle: int, delay: float, peer: Peer, now: float) -> None:
        further = max(0, self._way(angle) - 1)  # the overhead holds one step
        due = now + further * self._timing.motor_step + self._ping_time() + delay
        self._position = angle
        bearing = math.remainder(self._zero - angle * 2 * math.pi / msg.TURN, 2 * math.pi)
        self.order = PingOrder(self.settings(), now, due, bearing, self._work(command, peer))

    def _next_angle(self, scan: msg.AutoTransmit) -> int:
        """Full turns keep their direction; a sector, which may wrap through 0, is scanned to and fro."""
        if not self._scan_begun:
            self._scan_begun = True
            return scan.start_angle
        span = (scan.stop_angle - scan.start_angle) % msg.TURN
        if span == msg.TURN - 1:
            return (self._position + scan.num_steps) % msg.TURN
        along = (self._position - scan.start_angle) % msg.TURN
        step = scan.num_steps if self._forwards else -scan.num_steps
        if not 0 <= along + step <= span:
            self._forwards = not self._forwards
            step = -step
        # A sector narrower than one step leaves the head where it is.
        return (scan.start_angle + along + step) % msg.TURN if 0 <= along + step <= span else self._position


def _settings_of(m: _Command) -> tuple[int, int, int, int, int, int]:
    return (
        m.mode, m.gain_setting, m.transmit_duration, m.sample_period, m.transmit_frequency, m.number_of_samples,
    )  # fmt: skip


def _data(registers: msg.Transducer, data: bytes) -> msg.DeviceData:
    return msg.DeviceData(*_settings_of(registers)[:2], registers.angle, *_settings_of(registers)[2:], data)


def _auto_data(scan: msg.AutoTransmit, registers: msg.Transducer, data: bytes) -> msg.AutoDeviceData:
    s = scan
    return msg.AutoDeviceData(
        s.mode, s.gain_setting, registers.angle, s.transmit_duration, s.sample_period, s.transmit_frequency,
        s.start_angle, s.stop_angle, s.num_steps, s.delay, s.number_of_samples, data,
    )  # fmt: skip
