"""Diagnosis: which physical effect a model is missing, or that none explains what is left."""

from .change_points import ChangePoint
from .coherence import Coherence
from .constancy import Constancy, constancy
from .delay import Delay
from .diagnose import Candidate, Diagnosis, considered, diagnose
from .force_map import ForceMap
from .hiding import Bias, BiasReport, bias_report
from .next_drive import DriveLimits, NextDrive, Suggestion, separations, suggest_manoeuvre
from .omnibus import Omnibus, omnibus
from .proposals import Proposal
from .shape import Curve, Surface
from .unknown import Unknown, unknown
from .verdicts import EffectVerdict, Verdicts, judge, possible, verdicts
from .where import Where, where

__all__ = [
    "Bias",
    "BiasReport",
    "Candidate",
    "ChangePoint",
    "Coherence",
    "Constancy",
    "Curve",
    "Delay",
    "Diagnosis",
    "DriveLimits",
    "EffectVerdict",
    "ForceMap",
    "NextDrive",
    "Omnibus",
    "Proposal",
    "Suggestion",
    "Surface",
    "Unknown",
    "Verdicts",
    "Where",
    "bias_report",
    "considered",
    "constancy",
    "diagnose",
    "judge",
    "omnibus",
    "possible",
    "separations",
    "suggest_manoeuvre",
    "unknown",
    "verdicts",
    "where",
]
