"""Servers for browsers: pages, files and WebSockets, on this machine or beyond it."""
