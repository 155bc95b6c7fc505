"""Identification of tyres: data, search, intervals, validation."""
