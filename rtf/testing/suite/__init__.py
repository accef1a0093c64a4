"""The model of suites, and the XML that they are read from."""
