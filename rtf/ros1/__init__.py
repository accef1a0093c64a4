"""ROS 1 without ROS: topics and services of a master, with the names, types and bytes of ROS 1.

The package rosbags (extra ``ros``) encodes messages and has the standard ones. :class:`~rtf.ros1.node.Node` is a node
with topics and services, and :class:`~rtf.ros1.bridge.RobotBridge` publishes a robot of the network.
"""
