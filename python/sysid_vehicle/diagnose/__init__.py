"""Diagnosis: which physical effect a model is missing, or that none explains what is left."""

from .diagnose import Candidate, Diagnosis, diagnose
from .omnibus import Omnibus, omnibus

__all__ = ["Candidate", "Diagnosis", "Omnibus", "diagnose", "omnibus"]
