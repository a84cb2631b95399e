"""Each model role alone: asked over HTTP about pictures and requests of the task set, judged by the truth."""
