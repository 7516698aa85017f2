"""Baselines: what may not get worse unseen."""
