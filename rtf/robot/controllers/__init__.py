"""Controllers of several joints, as equations: they know neither boards nor ports nor clocks."""
