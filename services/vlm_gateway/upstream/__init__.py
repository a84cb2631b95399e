"""One model behind one server: connections, breaker and retries around them, replies read into typed errors."""
