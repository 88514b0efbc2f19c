"""Tests of the package; `tests.helpers.scenes` builds the small scenes that they share."""
