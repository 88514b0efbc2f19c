"""Elastic-brittle bonds between grains."""
