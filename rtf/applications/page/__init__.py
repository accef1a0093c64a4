"""The page of applications: a manager and a builder in a browser, with the server of the other pages.

``document`` is what the browser edits, ``view`` what it is shown of it, ``control`` runs an application, and ``web``
answers the requests.
"""
