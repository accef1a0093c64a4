"""The server side of the web page: live server, archive, series and files of a run. The page itself is data.

The server is a process of its own and reads the files that the runner writes; nothing here runs in the process of a
test.
"""
