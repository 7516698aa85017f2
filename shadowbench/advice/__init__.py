"""What a scene needs least, and parameters at their best."""
