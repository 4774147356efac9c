"""The version of the package, as it was installed."""

from importlib import metadata

__version__: str = metadata.version("roscausal")
