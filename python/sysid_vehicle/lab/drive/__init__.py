"""The closed loop, and what came of it."""
