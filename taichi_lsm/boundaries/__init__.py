"""What bounds the grains: the periodic or sheared cell, plane walls, platens and their drives."""
