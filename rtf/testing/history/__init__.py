"""The history: verdicts and measurements of all runs of a station in one SQLite file, and their trends."""

from rtf.testing.history.database import History, HistoryError, StoredRun, default_place
from rtf.testing.history.trends import trends, trends_for_a_run

__all__ = ["History", "HistoryError", "StoredRun", "default_place", "trends", "trends_for_a_run"]
