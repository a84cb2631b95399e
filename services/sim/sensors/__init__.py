"""What real sensors make of what is drawn and flown: depth, pictures, and the chance they draw from."""
