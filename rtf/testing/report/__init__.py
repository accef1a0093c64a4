"""What several reporters need: texts, files that are whole or not there, problems, a live region."""
