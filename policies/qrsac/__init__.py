"""Quantile-regression soft actor-critic (QR-SAC): knows nothing of racing."""
