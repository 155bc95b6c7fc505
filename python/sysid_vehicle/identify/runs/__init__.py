"""Several runs at once, whose parameters differ or are tied."""
