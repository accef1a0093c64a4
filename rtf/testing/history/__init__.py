"""Verdicts and measurements of all runs of a station, in one SQLite file, and what they say over time."""

from rtf.testing.history.database import History, HistoryError, StoredRun, default_place
from rtf.testing.history.trends import trends

__all__ = ["History", "HistoryError", "StoredRun", "default_place", "trends"]
