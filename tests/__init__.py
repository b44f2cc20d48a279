"""MorphID's proofs, room by room as the source tree."""
