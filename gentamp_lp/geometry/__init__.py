"""Shapes, collisions, robots and pictures: the only part of the package that knows geometry."""
