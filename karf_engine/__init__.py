"""KaRF: weakly supervised Kolmogorov-Arnold radiance fields for local color editing. Importing this imports nothing."""

__version__ = "0.1.0"
