"""The motion that all sensors read, as splines, and the faults that make them agree."""
