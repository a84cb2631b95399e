"""A parser alone, asked about requests whose floor and object people have labelled."""
