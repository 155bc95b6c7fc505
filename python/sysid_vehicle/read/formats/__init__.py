"""Readers of file formats, and of what is in memory."""
