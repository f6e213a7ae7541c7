"""Training: worlds make transitions, rewards value them, QR-SAC learns from them."""
