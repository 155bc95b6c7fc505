"""What searches minimise, where they begin, and their ways to the best parameters."""
