"""Insertions: marched along the cut path or stepped in time, with their energy ledger."""
