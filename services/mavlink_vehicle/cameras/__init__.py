"""The vehicle's cameras: one port, two sources."""
