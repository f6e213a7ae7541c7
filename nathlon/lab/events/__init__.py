"""Events: long races driven leg by leg, weekends and seasons."""
