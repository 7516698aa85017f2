uniform vec3 eye;  // of the camera
