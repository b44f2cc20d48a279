"""Reproduction of every table and figure of the paper, with our own flexible model as the truth."""

from __future__ import annotations

from morphcore.paper.paper import paper_runner
from morphcore.paper.report.report import summary_document, write_report
from morphcore.paper.settings import PaperSettings
from morphcore.paper.stages import Progress, Stage, StageRunner

__all__ = [
    "PaperSettings",
    "Progress",
    "Stage",
    "StageRunner",
    "paper_runner",
    "summary_document",
    "write_report",
]
