// Empty: no bias, or one of the depth pass (polygon offset, front-face culling).
