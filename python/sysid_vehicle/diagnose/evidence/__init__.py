"""Scores of the likelihood, their directions, and the algebra that all tests share."""
