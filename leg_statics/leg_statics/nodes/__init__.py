"""ROS nodes of statics, maps and designs, and what they read and answer."""
