"""Diagnosis: which physical effect a model is missing, or that none explains what is left."""

from .causes import Causes, CredibleSet
from .ceiling import Ceiling, Explainable, ceiling
from .change import Change, EffectChange
from .change_points import ChangePoint
from .changed import changed
from .coherence import INPUTS, Coherence, coherence
from .constancy import Constancy, constancy
from .coordinates import blocks
from .delay import Delay
from .diagnose import considered, diagnose
from .diagnosis import Candidate, Diagnosis
from .evidence import Evidence
from .force_map import ForceMap
from .hiding import Bias, BiasReport, bias_report
from .instead import Instead, instead
from .next_drive import DriveLimits, NextDrive, separations, suggest_manoeuvre
from .omnibus import Omnibus, omnibus
from .possible import Size, possible
from .proposals import Proposal
from .shape import Curve, Surface
from .suggestion import Suggestion
from .unknown import Unknown, unknown
from .verdicts import EffectVerdict, Verdicts, judge, verdicts
from .where import Where, where

__all__ = [
    "INPUTS",
    "Bias",
    "BiasReport",
    "Candidate",
    "Causes",
    "Ceiling",
    "Change",
    "ChangePoint",
    "Coherence",
    "Constancy",
    "CredibleSet",
    "Curve",
    "Delay",
    "Diagnosis",
    "DriveLimits",
    "EffectChange",
    "EffectVerdict",
    "Evidence",
    "Explainable",
    "ForceMap",
    "Instead",
    "NextDrive",
    "Omnibus",
    "Proposal",
    "Size",
    "Suggestion",
    "Surface",
    "Unknown",
    "Verdicts",
    "Where",
    "bias_report",
    "blocks",
    "ceiling",
    "changed",
    "coherence",
    "considered",
    "constancy",
    "diagnose",
    "instead",
    "judge",
    "omnibus",
    "possible",
    "separations",
    "suggest_manoeuvre",
    "unknown",
    "verdicts",
    "where",
]
