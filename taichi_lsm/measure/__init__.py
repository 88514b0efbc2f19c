"""What is measured of a simulation: sums, energy budget, layers, statistics."""
