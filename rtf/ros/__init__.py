"""What ROS 1 and ROS 2 share: a robot of the network as joint states, pictures and forces in SI units."""
