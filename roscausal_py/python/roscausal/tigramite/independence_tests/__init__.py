"""The independence tests, each in a module of its own as in tigramite."""
