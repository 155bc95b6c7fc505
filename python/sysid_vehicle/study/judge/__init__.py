"""What is measured of the final model for its verdict, and of the effects for their names."""
