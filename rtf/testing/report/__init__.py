"""What several reporters need: texts, files that are whole or not there, troubles, a live region."""
