"""What calls cost, by key, team and model: budgets that are reserved from before a call, and a store that remembers."""
