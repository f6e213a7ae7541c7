"""What selecting is worth, and how many races it takes."""
