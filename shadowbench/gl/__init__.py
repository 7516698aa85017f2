"""OpenGL: the context, shaders, the G-buffer, render targets and clocks. The only subpackage that uses PyGLM."""
