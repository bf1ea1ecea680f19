"""graspsense as a ROS 2 node, and grippers behind ROS 2, through zenoh or rclpy."""
