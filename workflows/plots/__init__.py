"""Figures of the workflows."""
