// Two biases, one after the other.
#include <bias_first> with bias = bias_first
#include <bias_second> with bias = bias_second

ShadowCoord bias(ShadowCoord p) { return bias_second(bias_first(p)); }
