"""Load capacity: one problem, a quick way for three joints, and one that tries all planes."""
