"""Errors some seconds ahead of the models of a study, and what takes them away."""
