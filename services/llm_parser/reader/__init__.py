"""The learned reader: a small encoder that says which mention is the customer's; arithmetic of floors stays rules."""
