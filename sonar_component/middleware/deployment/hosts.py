"""Which TCP addresses a deployment on several hosts takes: counted up from each host's port, as the file goes on."""

from __future__ import annotations

from collections.abc import Callable

from sonar_component.middleware.deployment.file import DeploymentFile
from sonar_component.middleware.deployment.plan import ConnectionPlan
from sonar_component.settings.loader import KeyPath

Wrong = Callable[[KeyPath, str], None]


class Hosts:
    """The hosts of a file whose tasks name no others.

    Parameters
    ----------
    wrong : told of each mistake.
    """

    def __init__(self, file: DeploymentFile, wrong: Wrong) -> None:
        self.file, self.wrong = file, wrong
        first = next(iter(file.hosts), "")
        self.of = {name: spec.host or first for name, spec in file.tasks.items()}

    def plan(self, connections: list[ConnectionPlan]) -> tuple[dict[str, str], dict[str, str]]:
        """Addresses of ports that are read from other hosts, and of the processes that can be asked from there."""
        if self.file.clock.mode == "sim" and len(set(self.of.values())) > 1:
            self.wrong(("clock", "mode"), "sim needs all tasks on one host: no clock is shared between hosts")
        addresses = self._addresses(connections)
        controls = self._controls(addresses)
        self._no_clash({**addresses, **controls})
        return addresses, controls

    @property
    def open(self) -> bool:
        """Whether others can read and ask without keys: what the file allows, and an address that they can reach."""
        return self.file.insecure and any(h.key is None and not h.is_loopback for h in self.file.hosts.values())

    def _addresses(self, connections: list[ConnectionPlan]) -> dict[str, str]:
        """TCP addresses of the ports that are read from another host, counted from the host's first port."""
        found: dict[str, str] = {}
        used: dict[str, int] = {}
        for connection in connections:
            writer, reader = (self.of.get(end.partition(".")[0]) for end in (connection.source, connection.target))
            if writer is None or reader is None or writer == reader or connection.source in found:
                continue
            self._guarded(writer)
            host = self.file.hosts[writer]
            found[connection.source] = f"tcp://{host.address}:{host.port + used.get(writer, 0)}"
            used[writer] = used.get(writer, 0) + 1
        return found

    def _controls(self, addresses: dict[str, str]) -> dict[str, str]:
        """TCP addresses at which processes are asked from other hosts: after those of the host's ports.

        A host that may not open any, since others could reach it and it has no key, is asked from itself alone.
        """
        used = [self._host_of(port) for port in addresses]
        found: dict[str, str] = {}
        for name, host in self.file.hosts.items():
            tasks = [(task, spec) for task, spec in self.file.tasks.items() if self.of[task] == name]
            processes = dict.fromkeys(spec.process or task for task, spec in tasks)
            if self._may_open(name):
                numbered = enumerate(processes, host.port + used.count(name))
                found |= {f"{name}/{process}": f"tcp://{host.address}:{number}" for number, process in numbered}
        return found

    def _no_clash(self, addresses: dict[str, str]) -> None:
        """Two hosts on one machine, as in a rehearsal, must not count through the same TCP ports."""
        owners: dict[str, str] = {}
        for owner, address in addresses.items():
            first = owners.setdefault(address, owner)
            if first != owner:
                host = owner.partition("/")[0] if "/" in owner else self._host_of(owner)
                self.wrong(("hosts", host), f"{address} is taken by {first}: give this host another port or address")
                return

    def _host_of(self, port: str) -> str:
        return self.of[port.partition(".")[0]]

    def _may_open(self, name: str) -> bool:
        host = self.file.hosts[name]
        return host.is_loopback or host.key is not None or self.file.insecure

    def _guarded(self, name: str) -> None:
        """An address that others can reach needs a key, or a word that none is wanted."""
        if not self._may_open(name):
            address = self.file.hosts[name].address
            message = f"address {address} can be reached by others: give key (sonar keys new {name}), or insecure: true"
            self.wrong(("hosts", name), message)
