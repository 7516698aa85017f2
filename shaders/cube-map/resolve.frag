// As from one map.
#include "shadow-map/resolve.frag"
