"""World and pose to samples: range, span of ranges, echo strength for every cell of a fan."""
