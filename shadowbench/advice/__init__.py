"""Recommending the cheapest technique for a view, and tuning a technique's parameters."""
