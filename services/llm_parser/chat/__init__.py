"""A language model behind the gateway, asked as the paper asks: few-shot, in three steps."""
