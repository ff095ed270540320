"""What carries samples between processes: ZeroMQ sockets, their owner thread and their limits."""
