"""The particle swarm of an identification; the search itself is in morphcore/swarm.py."""

from __future__ import annotations

from morphcore.swarm import SwarmSettings, SwarmState, first_swarm, next_swarm

__all__ = ["SwarmSettings", "SwarmState", "first_swarm", "next_swarm"]
