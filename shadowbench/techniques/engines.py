"""Biases and filters that engines ship for a sun, as parameters of map techniques; looked up in their sources.

`normal-offset(scale)` is a multiple of the filter's radius in texel diagonals: n texels at grazing light, with a filter
of radius r, are scale = n/(r √2). It falls with sin θ as in Filament; in Godot and Unity with 1 − cos θ, in Bevy not.
"""

# LightShadow: bias 0, normalBias 0; WebGLShadowMap: of materials with a front side the map has the back faces;
# PCFShadowMap: 5 taps within radius 1.
THREE = "bias=front-cull,filter=pcf-disc(width=1,taps=5,plane=false)"
# ShadowGenerator: bias 5e-5 of the depth range, normalBias 0; contact hardening at high quality, light size ratio 0.1.
BABYLON = "bias=constant(5e-05),filter=pcss(variant=babylon,search=32,taps=64,pattern=poisson)"
# Light3D: shadow_bias 0.1, which is 0.001 m; shadow_normal_bias 1 texel; soft filter of low quality: 4 taps, radius 2.
GODOT = "bias=normal-offset(0.236)+constant(world=0.001),filter=pcf-disc(width=2,taps=4,plane=false)"
# DirectionalLight: shadow_depth_bias 0.02 m, shadow_normal_bias 1.8, of texel diagonals; the Gaussian filter.
BEVY = "bias=normal-offset(0.6)+constant(world=0.02),filter=castano(5)"
# ShadowOptions: constantBias 0.001 m, normalBias 1, of which half a texel, polygon offset 2 and 0.5; ShadowType::PCF.
FILAMENT = "bias=polygon-offset(2,0.5)+normal-offset(0.177)+constant(world=0.001),filter=castano(3)"
# URP: depth and normal bias of 1 texel each, times 2.5 with soft shadows, whose tent is 5 texels wide. A receiver plane
# without a gradient is a bias in texels.
UNITY = "bias=normal-offset(0.589)+receiver-plane(limit=1e-9,slack=2.5),filter=castano(5)"
