"""Diagnosis: which physical effect a model is missing, or that none explains what is left."""

from .diagnose import Candidate, Diagnosis, diagnose
from .hiding import Bias, BiasReport, bias_report
from .next_drive import DriveLimits, NextDrive, Suggestion, separations, suggest_manoeuvre
from .omnibus import Omnibus, omnibus
from .verdicts import EffectVerdict, Verdicts, judge, verdicts

__all__ = [
    "Bias",
    "BiasReport",
    "Candidate",
    "Diagnosis",
    "DriveLimits",
    "EffectVerdict",
    "NextDrive",
    "Omnibus",
    "Suggestion",
    "Verdicts",
    "bias_report",
    "diagnose",
    "judge",
    "omnibus",
    "separations",
    "suggest_manoeuvre",
    "verdicts",
]
