"""Programs of an application: where they run, and how they are started, watched and ended there."""
