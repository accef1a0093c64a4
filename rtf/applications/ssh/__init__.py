"""Programs on machines that are reached by ssh, where nothing of RTF is installed."""
