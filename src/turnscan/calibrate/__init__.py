"""Views of a target or an artefact → Rig + covariance + findings."""
