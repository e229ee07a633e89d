"""Programs that entries start as processes of their own."""
