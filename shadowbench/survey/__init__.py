"""What a scene asks of shadows, from geometry, camera, light and traced rays: no technique is drawn. Knows no GL."""
