"""Parts that several reporters use: texts, files that are complete or absent, problems, a live region."""
