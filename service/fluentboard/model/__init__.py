"""Words of the project: intervals, fluents, geometry, YAML."""
