"""What every simulated world's service shares: episodes held by leases, numbered moves, straight flight."""
