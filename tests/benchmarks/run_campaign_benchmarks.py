"""Measure the report of a campaign and the queries of a large history.

Usage: ``python tests/benchmarks/run_campaign_benchmarks.py``. The outcomes are simulated, and the history is made of
their rows; nothing is run.
"""

from __future__ import annotations
