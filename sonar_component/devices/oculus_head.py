"""What an Oculus-compatible multibeam sonar does with messages and time, without I/O.

Once a client has sent a fire message the device pings at most at the rate that it asks for, and never faster than sound
comes back from the greatest range and the device has worked; in standby, and to a client that has not fired yet, it
sends dummies so that nobody takes the line for dead. There is no negative answer: what is out of range is clamped, and
the answer tells the value in use. Deadlines are absolute, so that the mean rate is the one asked for; a ping that is
late by a whole period begins the count anew.

A speed of sound that the client sets is the one the device reckons with: where the water's is another, ranges are wrong
in proportion, as they are with the device.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sonar_component.devices.echoes import PingOrder
from sonar_component.devices.link import Arrival, Kind, Outgoing, Peer
from sonar_component.devices.oculus_messages import RATES, Fire, Flags, MessageId, PingRate, Result, Status, header
from sonar_component.devices.oculus_protocol import OculusParser
from sonar_component.samples import Sonar
from sonar_component.sonars.settings import ForwardLookingSettings

_STATUS_PERIOD = 1.0  # [s]; clients give up after 5
_DUMMY_PERIOD = 0.5  # [s]; clients give up after 10
_SPEED_LIMITS = (1300.0, 1700.0)  # [m/s], what the sonar's own settings take
_PASCAL_PER_METRE, _PASCAL_PER_BAR = 1025 * 9.81, 1e5


@dataclass(frozen=True)
class Mode:
    """One of the device's two frequencies.

    Attributes
    ----------
    frequency : float [Hz]; beam_width, beam_height : float [rad]; max_range : float [m].
    """

    frequency: float
    beam_width: float
    beam_height: float
    max_range: float


@dataclass(frozen=True)
class Model:
    """The device.

    Attributes
    ----------
    low, high : Mode
    min_range : float
        Least range that can be asked for [m].
    overhead : float
        From the last echo to the message, and the least pause between two pings [s].
    device_id, part_number : int
    """

    low: Mode
    high: Mode
    min_range: float = 0.3
    overhead: float = 5e-3
    device_id: int = 0xF001
    part_number: int = 1042


class OculusHead:
    """Settings, pace and answers.

    Parameters
    ----------
    sonar : ForwardLookingSettings
        Everything that clients do not set.
    status_to : Peer or None
        Where to tell the status.
    address : str
        IPv4 address that clients are told to connect to.
    """

    def __init__(
        self, sonar: ForwardLookingSettings, model: Model, status_to: Peer | None = None, address: str = "127.0.0.1"
    ) -> None:
        self._sonar, self._model, self._status_to, self._address = sonar, model, status_to, address
        self._client: Peer | None = None
        self._parser = OculusParser()
        self._fire: Fire | None = None
        self._ping_id = 0
        self._next_ping = self._next_dummy = math.inf
        self._next_status = -math.inf
        self._tables: dict[tuple[int, int], list[float]] = {}
        self._settings: ForwardLookingSettings | None = None
        self.order: PingOrder | None = None

    def settings(self) -> ForwardLookingSettings:
        """Settings of the sonar for the fire message in force; the same object until that changes."""
        if self._settings is None:
            fire, s = self._fire or self.clamped(Fire()), self._sonar
            mode = self._mode(fire)
            ratio = s.speed_of_sound / self._speed(fire)  # metres of water to a metre of the device's
            bearings = np.radians(-self._bearings(fire)).tolist()
            water = s.attenuation_properties.model_copy(update={"frequency": min(mode.frequency, 1e6)})
            values = s.model_dump(exclude={"attenuation_properties"}) | {
                "range": self._range(fire) * ratio, "gain": fire.gain / 100, "bearings": bearings,
                "beam_count": len(bearings), "beam_width": mode.beam_width, "beam_height": mode.beam_height,
                "attenuation_properties": water.model_dump(),
            }  # fmt: skip
            self._settings = ForwardLookingSettings.model_validate(values)
        return self._settings

    def clamped(self, fire: Fire) -> Fire:
        """The fire message as the device takes it."""
        mode = fire.master_mode if fire.master_mode in (1, 2) else (self._fire.master_mode if self._fire else 2)
        rate = fire.ping_rate if fire.ping_rate in PingRate.__members__.values() else PingRate.NORMAL
        fire = replace(fire, master_mode=mode, ping_rate=rate, gain=min(max(fire.gain, 0.0), 100.0))
        if fire.speed_of_sound:
            fire = replace(fire, speed_of_sound=min(max(fire.speed_of_sound, _SPEED_LIMITS[0]), _SPEED_LIMITS[1]))
        most = self._mode(fire).max_range
        if not fire.flags & Flags.RANGE_IN_METRES:
            return replace(fire, range=min(max(fire.range, 100 * self._model.min_range / most), 100.0))
        return replace(fire, range=min(max(fire.range, self._model.min_range), most))

    def receive(self, arrival: Arrival, now: float) -> list[Outgoing]:
        """A client comes, goes or speaks."""
        if arrival.kind is Kind.OPENED:
            self._client, self._parser, self._fire = arrival.peer, OculusParser(), None
            self._next_dummy = now
        elif arrival.kind is Kind.CLOSED and arrival.peer == self._client:
            self._client = self._fire = self.order = None
            self._next_ping = self._next_dummy = math.inf
        elif arrival.kind is Kind.DATA and arrival.peer == self._client:
            for message in self._parser.feed(arrival.data):
                if isinstance(message, Fire):
                    self._take(self.clamped(message), now)
        return []

    def begin(self, now: float) -> PingOrder | None:
        """Begin the next ping when its time has come."""
        if self.order is not None or self._fire is None or now < self._next_ping:
            return None
        fire, period = self._fire, self.period()
        began = self._next_ping if now - self._next_ping < period else now
        self._next_ping = began + period
        self._ping_id += 1
        due = began + self._time_of_flight() + self._model.overhead
        self.order = PingOrder(self.settings(), began, due, note=(fire, self._ping_id))
        return self.order

    def period(self) -> float:
        """Time between two pings [s]: the client's rate, if sound and device keep up with it."""
        assert self._fire is not None
        return max(1 / RATES[PingRate(self._fire.ping_rate)], self._time_of_flight() + self._model.overhead)

    def finish(self, sample: Sonar, now: float) -> list[Outgoing]:
        """The ping as a message."""
        assert self.order is not None
        fire, ping_id = self.order.note
        began, self.order = self.order.began, None
        if self._client is None:
            return []
        self._next_dummy = now + _DUMMY_PERIOD
        result = self.result(sample, fire, ping_id, began)
        return [(self._client, result.message(self._model.device_id & 0xFFFF))]

    def tick(self, now: float) -> list[Outgoing]:
        """Status once a second; a dummy where nothing else is to be sent."""
        found: list[Outgoing] = []
        if self._status_to is not None and now >= self._next_status:
            late = now - self._next_status > _STATUS_PERIOD
            self._next_status = (now if late else self._next_status) + _STATUS_PERIOD
            found.append((self._status_to, self.status().message(self._model.device_id & 0xFFFF)))
        if self._client is not None and now >= self._next_dummy:
            self._next_dummy = now + _DUMMY_PERIOD
            if self._fire is None or self._fire.ping_rate == PingRate.STANDBY:
                found.append((self._client, header(MessageId.DUMMY, 0, 1, self._model.device_id & 0xFFFF)))
        return found

    def next_tick(self) -> float:
        """When status, dummy or ping are wanted."""
        status = self._next_status if self._status_to is not None else math.inf
        return min(status, self._next_dummy, self._next_ping if self.order is None else math.inf)

    def status(self) -> Status:
        """What the device says of itself."""
        client = "0.0.0.0"
        if self._client is not None and isinstance(self._client.address, tuple):
            client = self._client.address[0]
        return Status(self._model.device_id, self._model.part_number, self._address, client)

    def result(self, sample: Sonar, fire: Fire, ping_id: int, began: float) -> Result:
        """A ping's echoes as the device tells them."""
        shown = np.where(np.isfinite(sample.bins), sample.bins, np.float32(0)).T  # (ranges, beams)
        if 0 < fire.gamma < 255:
            shown = shown ** np.float32(fire.gamma / 255)
        image, gains = digitised(shown, fire.sample_bytes, bool(fire.flags & Flags.SEND_GAIN))
        heading, pitch, roll = attitude(sample.sensor_orientation)
        depth = max(0.0, -float(sample.sensor_position[2]))  # NaN, where there is no pose yet, gives 0
        return Result(
            self._told(fire), ping_id, self._mode(fire).frequency, began, self._range(fire) / len(shown),
            self._bearings(fire), image, gains, self._speed(fire),
            self._sonar.attenuation_properties.temperature - 273.15, depth * _PASCAL_PER_METRE / _PASCAL_PER_BAR,
            heading, pitch, roll,
        )  # fmt: skip

    def _take(self, fire: Fire, now: float) -> None:
        if fire == self._fire:
            return
        self._fire, self._settings = fire, None
        self._next_ping = math.inf if fire.ping_rate == PingRate.STANDBY else now
        if fire.ping_rate == PingRate.STANDBY:
            self.order, self._next_dummy = None, now

    def _told(self, fire: Fire) -> Fire:
        # The device's own scale: clients of the high frequency wait until the echoed gain is this.
        return replace(fire, gain=40 + 0.6 * fire.gain) if fire.master_mode == 2 else fire

    def _mode(self, fire: Fire) -> Mode:
        return self._model.high if fire.master_mode == 2 else self._model.low

    def _range(self, fire: Fire) -> float:
        return fire.range if fire.flags & Flags.RANGE_IN_METRES else fire.range / 100 * self._mode(fire).max_range

    def _speed(self, fire: Fire) -> float:
        return fire.speed_of_sound or self._sonar.speed_of_sound

    def _time_of_flight(self) -> float:
        assert self._fire is not None
        return 2 * self._range(self._fire) / self._speed(self._fire)

    def _bearings(self, fire: Fire) -> NDArray[np.float64]:
        """Beam centres [deg], positive to the right: equal steps in sine, the outermost on the edges of the fan."""
        edge = math.sin(self._mode(fire).beam_width / 2)
        return np.degrees(np.arcsin(np.linspace(-edge, edge, fire.beam_count)))


def digitised(
    shown: NDArray[np.float32], sample_bytes: int, with_gains: bool
) -> tuple[NDArray[np.unsignedinteger], NDArray[np.uint32] | None]:
    """Echoes as the device's integers.

    Parameters
    ----------
    shown : (ranges, beams) float32
        0 to 1.
    with_gains : bool
        Amplify each row as far as it goes; clients divide by the square root of its gain.

    Returns
    -------
    image : (ranges, beams) uint8, uint16 or uint32
    gains : (ranges,) uint32 or None
    """
    full = float(256**sample_bytes - 1)
    dtype = f"<u{sample_bytes}"
    if not with_gains:
        return np.rint(shown.astype(np.float64) * full).astype(dtype), None
    greatest = np.maximum(shown.max(axis=1).astype(np.float64), 1e-4)  # bounds the gain of an empty row at 1e8
    gains = np.floor(1 / greatest**2)
    return np.rint(shown * (full * np.sqrt(gains))[:, None]).astype(dtype), gains.astype(np.uint32)


def attitude(orientation: NDArray[np.float64]) -> tuple[float, float, float]:
    """Heading, pitch and roll [deg] of a quaternion (w, x, y, z) in a North-West-Up world: nose up is positive."""
    if not np.isfinite(orientation).all():
        return 0.0, 0.0, 0.0
    w, x, y, z = (float(v) for v in orientation)
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - x * z))))
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    return math.degrees(-yaw) % 360, -math.degrees(pitch), math.degrees(roll)
