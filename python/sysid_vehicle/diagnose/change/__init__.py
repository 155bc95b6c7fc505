"""What changed in a car between two drives."""
