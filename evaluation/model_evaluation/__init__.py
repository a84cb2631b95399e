"""How well a vision model sees: fresh streets rendered once, the gateway asked about them, figures, the model card."""
