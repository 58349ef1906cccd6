"""What is known of the place: zones, ground plane, scenarios."""
