"""The vehicles that a mission can fly; `mission.vehicles.agreement` is what all of them keep."""
