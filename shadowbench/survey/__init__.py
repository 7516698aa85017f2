"""What a scene needs of a shadow technique, computed from geometry, camera, light and traced rays, without OpenGL."""
