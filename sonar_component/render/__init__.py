"""World and pose to samples: range, extent in range, echo strength for every cell of a fan."""
