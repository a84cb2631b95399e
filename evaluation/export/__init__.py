"""A run in other people's formats: LeRobot, Rerun, MCAP, COCO."""
