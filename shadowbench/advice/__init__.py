"""Recommending the cheapest technique for a view."""
