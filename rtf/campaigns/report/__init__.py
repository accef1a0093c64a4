"""The report of a campaign: pure functions from outcomes to plain data, and the files that are made of these.

``detection``, ``healthy``, ``distributions`` and ``costs`` evaluate, each on its own; ``summary`` puts them together,
``compare`` says what differs between two campaigns, ``files`` writes. It needs SciPy (``pip install 'rtf[campaign]'``).
"""
