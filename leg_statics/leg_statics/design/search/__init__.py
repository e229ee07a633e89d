"""The search for better legs: studies, methods, workers, tables and reports."""
