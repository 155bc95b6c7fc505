"""The way to a better model: what is added, exchanged, or dropped again."""
