"""The ontologies of fluentboard, as files that travel with the package."""
