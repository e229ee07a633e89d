"""ROS nodes: what they share, and the kinematics node."""
