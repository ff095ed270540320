"""Samples to beams x bins: bearing tables, and footprints spread over the bins that they cover."""
