"""Designing a drive: what it will teach, before anything is driven."""
