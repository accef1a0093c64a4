"""ROS 2 without ROS: topics over DDS, with the names, types and qualities of service of ROS 2.

The package cyclonedds (extra ``dds``) is the DDS. :class:`~rtf.ros2.node.Node` is a node with topics, and
:class:`~rtf.ros2.bridge.RobotBridge` publishes a robot of the network.
"""
