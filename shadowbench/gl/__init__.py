"""How it is drawn: one OpenGL context, shaders, the G-buffer, depth targets and clocks. PyGLM and float32 live here."""
