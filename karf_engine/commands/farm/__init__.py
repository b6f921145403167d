"""Job bundles for render farms, by the Open Job Description specification; any farm or `openjd run` can execute them."""

from .bundle import run

__all__ = ["run"]
