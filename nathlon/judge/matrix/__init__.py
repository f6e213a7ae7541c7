"""The settings matrix: a policy beside a baseline in every circuit, car, tyre, scenario, place and delay."""
