"""Diagnosis: which physical effect a model is missing, or that none explains what is left."""

from .candidates.candidate import Candidate
from .candidates.causes import Causes, CredibleSet
from .candidates.constancy import Constancy, constancy
from .candidates.diagnosis import Diagnosis
from .candidates.instead import Instead, instead
from .candidates.judge import judge, verdicts
from .candidates.possible import (
    Size,
    beside_what_they_refine,
    considered,
    possible,
    refining,
    refused,
)
from .candidates.verdicts import EffectVerdict, Verdicts
from .candidates.widened import widened
from .change.change import Change
from .change.effect_change import EffectChange, LoadChange
from .changed import changed
from .diagnose import diagnose, with_unfollowed
from .evidence.coordinates import blocks
from .evidence.evidence import Evidence
from .experiment.hiding import Bias, BiasReport, bias_report
from .experiment.limits import DriveLimits
from .experiment.next_drive import NextDrive, separations, suggest_manoeuvre
from .experiment.suggestion import Suggestion
from .unexplained.ceiling import Ceiling, Explainable, ceiling
from .unexplained.change_points import ChangePoint
from .unexplained.coherence import INPUTS, Coherence, coherence
from .unexplained.delay import Delay
from .unexplained.force_map import ForceMap
from .unexplained.omnibus import Omnibus, omnibus
from .unexplained.proposals import Proposal
from .unexplained.shape import Curve, Surface
from .unexplained.unknown import Unknown, unknown
from .unexplained.where import Where, where

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
    "LoadChange",
    "NextDrive",
    "Omnibus",
    "Proposal",
    "Size",
    "Suggestion",
    "Surface",
    "Unknown",
    "Verdicts",
    "Where",
    "beside_what_they_refine",
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
    "refining",
    "refused",
    "separations",
    "suggest_manoeuvre",
    "unknown",
    "verdicts",
    "where",
    "widened",
    "with_unfollowed",
]
