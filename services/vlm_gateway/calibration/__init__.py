"""`logisticsvln doctor --calibrate`: which box convention does a vision model really use?

`picture.py` draws coloured shapes whose boxes are known, `reading.py` finds boxes in whatever the model writes,
`fit.py` finds the convention under which they lie on the shapes, and `ask.py` does all of it with a model of the
gateway's. It talks to a running gateway over HTTP, as any client does.
"""
