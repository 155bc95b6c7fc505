"""Which column is which channel: maps, and proposals of maps by names, units and motion."""
