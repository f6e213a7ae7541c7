"""Worlds: simulators whose policies can be selected among, ours and others."""
