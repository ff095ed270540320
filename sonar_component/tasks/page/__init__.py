"""The viewer's live page: what is shown (board), how it travels (stream), who serves it (server), the world in 3-D."""

LOOPBACK = ("127.0.0.1", "::1", "localhost")  # addresses that only this computer can reach
