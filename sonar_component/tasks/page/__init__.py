"""The viewer's live page: what is shown (board), how it travels (stream), who serves it (server), the world in 3-D."""
