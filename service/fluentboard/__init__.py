"""fluentboard: a robot's long-term memory.

Importing this package loads no framework; the service lives in `fluentboard.api`.
"""

__version__ = "0.1.0"
