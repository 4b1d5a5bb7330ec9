"""Standing queries: registered SPARQL whose subscribers are told how its answer changes."""
