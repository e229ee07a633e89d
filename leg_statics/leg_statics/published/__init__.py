"""What the papers print, beside what this suite computes: one module a paper."""
