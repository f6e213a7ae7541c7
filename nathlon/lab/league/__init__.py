"""Leagues: generations of policies that are polished among their own kind and rated by the tournament."""
