"""Language models that are asked, and what was said."""
