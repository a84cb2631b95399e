"""Where the orchestrators keep their deliveries: tables of their own beside those of the engine, in one database."""
