"""What the laws of motion, and what any car can do, say of a log: units, signs, delays, clocks."""
