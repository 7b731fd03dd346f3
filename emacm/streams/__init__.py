"""Models applied to signals while they are measured."""
