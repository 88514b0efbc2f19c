"""Contact detection: the neighbour search, the geometry of touching surfaces, and what a pair of grains stores."""
