"""A fitted model as source text for a controller."""
