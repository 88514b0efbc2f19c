"""Tests of the package; `tests.scenes` builds the small scenes that they share."""
