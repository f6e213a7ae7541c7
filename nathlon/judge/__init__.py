"""Judgements beside a selection: gate, matrix, recipes, twins, ablations."""
