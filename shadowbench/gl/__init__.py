"""OpenGL: the context, shaders, the G-buffer, render targets and clocks. The only room that uses PyGLM."""
