"""Anthropic's messages in front of chat models: a request becomes a chat, the chat's answer a message."""
