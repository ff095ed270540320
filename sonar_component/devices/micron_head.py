"""What a Micron-compatible scanning head does with messages and time, without I/O.

It says that it is alive once a second, takes settings, and answers each request for data with one ping, after which the
head steps on. A ping lasts its samples, an overhead for the motor, and the time of the reply on the serial line. What
the settings say is told back with every ping exactly as it came, since drivers compare. Settings that no ping can be
made with are not taken: the head goes on saying that it has none, which is the only answer that it knows.

Angles: 6400 to a turn, clockwise seen from above, 3200 ahead.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from sonar_component.devices.echoes import PingOrder
from sonar_component.devices.link import Arrival, Kind, Outgoing, Peer
from sonar_component.devices.seanet_messages import (
    AHEAD,
    TICK,
    TURN,
    Alive,
    Control,
    HeadCommand,
    HeadData,
    HeadState,
    parse_head_command,
)
from sonar_component.devices.seanet_protocol import NODE, PC, MessageId, SeaNetMessage, SeaNetParser
from sonar_component.samples import Sonar
from sonar_component.sonars.scanning_settings import ScanningSettings

GAIN_MAX = 210
BINS_MAX = 1500
RANGE_LIMITS = (0.1, 200.0)  # [m]
_ALIVE_PERIOD = 1.0  # [s]
_QUEUE = 64  # [-], pings that a client may ask for ahead
_FREQUENCY_UNIT = 32e6 / 2**32  # [Hz]
_BITS_PER_BYTE = 10  # on the line: eight, a start and a stop
_PING_BYTES = 45  # beside the samples
_VERSION = bytes.fromhex("070f 5a5a 00380000 3c8c 02".replace(" ", ""))  # software 7, a processor number of our own
_BB_USER = bytes(161)  # zeros: a full-duplex line, no defaults of a user


class MicronHead:
    """Settings, sector and answers.

    Parameters
    ----------
    sonar : ScanningSettings
        Everything that clients do not set: opening of the beam, water, picture.
    overhead : float
        Of each ping, beside its samples and the serial line [s].
    baud : int
        Of the serial line [1/s].
    turn_time : float
        Of the motor for a whole turn, where it has farther to go than a step [s].
    """

    def __init__(
        self, sonar: ScanningSettings, overhead: float = 10e-3, baud: int = 115200, turn_time: float = 4.0
    ) -> None:
        self._sonar, self._overhead, self._baud, self._turn_time = sonar, overhead, baud, turn_time
        self._parser = SeaNetParser()
        self._peer: Peer | None = None
        self._next_alive = math.inf
        self.order: PingOrder | None = None
        self._reset()

    def _reset(self) -> None:
        self.command: HeadCommand | None = None
        self._woke: float | None = None
        self._position, self._way = AHEAD, 0
        self._rightwards = True
        self._wanted: deque[Peer] = deque(maxlen=_QUEUE)
        self._settings: ScanningSettings | None = None
        self.order = None

    def settings(self) -> ScanningSettings:
        """Settings of the sonar for the head command in force; the same object until that changes."""
        if self._settings is None:
            c, s = self.command or HeadCommand(), self._sonar
            frequency = (c.tx_1 + c.tx_2) / 2 * _FREQUENCY_UNIT
            water = s.attenuation_properties
            if 100 <= frequency <= 1e6:
                water = water.model_copy(update={"frequency": frequency})
            gain = 0.0 if c.control & Control.TRANSMITTER_OFF else min(c.gain_1, GAIN_MAX) / GAIN_MAX
            self._settings = s.model_copy(
                update={
                    "range": _range(c, s.speed_of_sound), "bin_count": _bins(c), "gain": gain,
                    "attenuation_properties": water,
                }
            )  # fmt: skip
        return self._settings

    def receive(self, arrival: Arrival, now: float) -> list[Outgoing]:
        """A client opens the line, or speaks."""
        self._peer, self._woke = arrival.peer, now if self._woke is None else self._woke
        if arrival.kind is Kind.OPENED:
            self._parser.reset()
            self._next_alive = now
        elif arrival.kind is Kind.CLOSED:
            self._next_alive = math.inf
        found: list[Outgoing] = []
        for message in self._parser.feed(arrival.data):
            found += self._answer(message, arrival.peer, now)
        return found

    def begin(self, now: float) -> PingOrder | None:
        """Begin the next ping that was asked for."""
        if self.order is not None or not self._wanted or self.command is None:
            return None
        peer = self._wanted.popleft()
        due = now + self._way / TURN * self._turn_time + self._ping_time(self.command)
        self._way = 0
        raw = self._position
        bearing = math.pi - 2 * math.pi * raw / TURN
        if self.command.control & Control.INVERTED:
            bearing = -bearing  # hung upside down, right and left change places
        bearing = math.remainder(bearing, 2 * math.pi)
        self.order = PingOrder(self.settings(), now, due, bearing, (self.command, raw, peer))
        self._step(self.command)
        return self.order

    def finish(self, sample: Sonar, now: float) -> list[Outgoing]:
        """The ping with its echoes."""
        assert self.order is not None
        command, raw, peer = self.order.note
        self.order = None
        data = _samples(sample.bins[0], command)
        c = command
        echoes = HeadData(
            0, 0, c.control, c.range_scale, c.tx_1, c.gain_1, c.slope_1, c.ad_span, c.ad_low, 0, c.ad_interval, c.left,
            c.right, c.step, raw, data,
        )  # fmt: skip
        return [(peer, _said(MessageId.HEAD_DATA, echoes.payload()))]

    def tick(self, now: float) -> list[Outgoing]:
        """A sign of life once a second while somebody has the line open."""
        if self._peer is None or now < self._next_alive:
            return []
        self._next_alive = now + _ALIVE_PERIOD
        state = HeadState.CENTRED | HeadState.NO_PARAMETERS
        if self.command is not None:
            state = HeadState.CENTRED | HeadState.MOTOR_ON | HeadState.CONFIGURED
        alive = Alive(round((now - (self._woke or now)) * 1e3), self._position, state)
        return [(self._peer, _said(MessageId.ALIVE, alive.payload()))]

    def next_tick(self) -> float:
        """When the next sign of life is wanted."""
        return self._next_alive

    def _answer(self, message: SeaNetMessage, peer: Peer, now: float) -> list[Outgoing]:
        kind = message.message_id
        if kind == MessageId.SEND_VERSION:
            return [(peer, _said(MessageId.VERSION_DATA, _VERSION))]
        if kind == MessageId.SEND_BB_USER:
            return [(peer, _said(MessageId.BB_USER_DATA, _BB_USER))]
        if kind == MessageId.REBOOT:
            self._reset()
            self._next_alive = now
        elif kind == MessageId.HEAD_COMMAND:
            self._take(message.payload, now)
        elif kind == MessageId.SEND_DATA and self.command is not None:
            self._wanted.append(peer)
        return []

    def _take(self, payload: bytes, now: float) -> None:
        try:
            command = parse_head_command(payload)
        except ValueError:
            return
        low, high = RANGE_LIMITS
        limits_kept = max(command.left, command.right) < TURN and 0 < command.step
        if not (low <= _range(command, self._sonar.speed_of_sound) <= high and limits_kept):
            return
        self.command, self._settings, self.order = command, None, None
        self._wanted.clear()
        self._rightwards = bool(command.control & Control.SCAN_RIGHT)
        if not command.control & Control.CONTINUOUS and not self._inside(command, self._position):
            start = command.left if self._rightwards else command.right
            self._way = abs((start - self._position + TURN // 2) % TURN - TURN // 2)
            self._position = start
        self._next_alive = now  # tells at once that it is configured

    def _inside(self, c: HeadCommand, position: int) -> bool:
        return (position - c.left) % TURN <= (c.right - c.left) % TURN

    def _step(self, c: HeadCommand) -> None:
        """Turn on; at the ends of a sector turn back."""
        if c.control & Control.MOTOR_OFF:
            return
        step = c.step if self._rightwards else -c.step
        if not c.control & Control.CONTINUOUS and not 0 <= self._along(c) + step <= (c.right - c.left) % TURN:
            self._rightwards = not self._rightwards
            step = -step
            if not 0 <= self._along(c) + step <= (c.right - c.left) % TURN:
                return  # the sector is narrower than a step
        self._position = (self._position + step) % TURN

    def _along(self, c: HeadCommand) -> int:
        return (self._position - c.left) % TURN

    def _ping_time(self, c: HeadCommand) -> float:
        reply = (_PING_BYTES + _data_bytes(c)) * _BITS_PER_BYTE / self._baud
        return _bins(c) * c.ad_interval * TICK + self._overhead + reply


def _bins(c: HeadCommand) -> int:
    return min(max(c.bin_count, 1), BINS_MAX)


def _data_bytes(c: HeadCommand) -> int:
    return _bins(c) if c.control & Control.ADC_8_BIT else -(-_bins(c) // 2)


def _range(c: HeadCommand, speed_of_sound: float) -> float:
    return _bins(c) * c.ad_interval * TICK * speed_of_sound / 2


def _samples(bins: np.ndarray[tuple[int], np.dtype[np.float32]], c: HeadCommand) -> bytes:
    """Echoes of 0 to 1 as bytes, or as halves of bytes that show the window of ad_low and ad_span."""
    full = np.rint(bins * 255)
    if c.control & Control.ADC_8_BIT:
        return full.astype(np.uint8).tobytes()
    shown = np.clip(np.rint((full - c.ad_low) * 15 / max(c.ad_span, 1)), 0, 15).astype(np.uint8)
    shown = np.append(shown, np.zeros(len(shown) % 2, np.uint8))
    return (shown[0::2] << 4 | shown[1::2]).astype(np.uint8).tobytes()


def _said(message_id: MessageId, payload: bytes) -> bytes:
    return SeaNetMessage(message_id, payload, source=NODE, destination=PC).encode()
