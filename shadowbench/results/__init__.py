"""What run folders hold: their rows as frames, summaries, comparisons and rankings."""
