"""The environments that Gymnasium makes by name."""
