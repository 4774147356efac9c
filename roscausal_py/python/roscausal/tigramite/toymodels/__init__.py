"""Toy models: series of known graphs, as in tigramite."""
