"""Tasks: where the halves meet. Each reads ports, calls the library, writes ports."""
