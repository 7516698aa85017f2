"""Scenes: meshes, cameras and lights, from files and shapes. Independent of OpenGL and Embree."""
