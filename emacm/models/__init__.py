"""Recipes: whole pipelines for a kind of machine."""
