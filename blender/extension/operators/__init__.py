"""What the buttons of the panel do."""

from . import check, places, scan, waiting

__all__ = ["CLASSES"]

CLASSES = (*waiting.CLASSES, *check.CLASSES, *scan.CLASSES, *places.CLASSES)
