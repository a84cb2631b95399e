"""Task sets: deliveries to fly, each proven by a flight of its own; the shipped set in `data`."""
