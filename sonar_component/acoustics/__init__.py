"""Formulas of underwater acoustics, each with its unit, range of validity and source."""
