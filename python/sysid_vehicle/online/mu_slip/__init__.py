"""The curve of friction over slip: filter, smoother, least squares, and their comparison."""
