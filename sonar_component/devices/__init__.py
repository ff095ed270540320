"""Stand-ins for real sonars on their own wires.

For each device: a codec of pure functions (``*_protocol.py``, ``*_messages.py``), a head that knows registers and
timing and does no I/O (``*_head.py``), and one endpoint, a task that puts the head on its wire (``ping360.py``,
``oculus.py``, ``micron.py``). What they share: ``link.py`` and the wires ``udp.py``, ``tcp.py``, ``pty.py``;
``echoes.py`` renders; ``station.py`` runs a head on its links; ``endpoint.py`` ties a station to ports.

The names of products say with what an endpoint is compatible; none of them is that product.
"""
