"""The demonstration with the red ball: a robot sees it, looks at it and reaches for it."""
