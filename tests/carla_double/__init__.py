"""A double of CARLA's server that speaks its wire protocol, drawn by our own simulator: the real client flies in it."""
