"""What stands behind the page: the live server, the archive, the series and files of a run. The page itself is data.

The server is a process of its own and reads what the runner writes; nothing here runs inside a test or a suite worker.
"""
