"""What the nodes share of rclpy: publishing, subscribing, diagnostics."""
