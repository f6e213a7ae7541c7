"""Rollout workers of a training run on the nodes of a Ray cluster."""
