"""Programs on other machines: the server that starts them there, and its client, both as YARP's ``yarprun``.

``RunServer`` is the node and ``RunClient`` talks to one, ours or YARP's. What a message says is in ``protocol``.
"""
