"""The version of the package."""

from . import _native

__version__: str = _native.version()
