// Nothing here: no bias, or one that belongs to the depth pass (polygon offset, front-face culling).
