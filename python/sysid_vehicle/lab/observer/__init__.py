"""The extended-state observer, and the learning of its noise."""
