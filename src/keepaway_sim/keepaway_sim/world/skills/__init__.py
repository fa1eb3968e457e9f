"""A requested high-level action made into this cycle's dash, turn or kick."""
