"""Biases and filters that engines ship or document for a sun, with the files that they come from.

`normal-offset(scale)` is a multiple of the filter's radius r in texel diagonals: n texels at grazing light are
scale = n/(r √2). Where an engine's map has 16 bits, no steps of that format are added to it, as they would be long.
"""

# mrdoob/three.js. LightShadow.js: bias 0, normalBias 0, radius 1, mapSize 512. WebGLShadowMap.js, shadowSide: the back
# faces of materials that show their front; here of all, as by `three:cast=back`. shadowmap_pars_fragment.glsl.js,
# SHADOWMAP_TYPE_PCF: 5 comparisons on a Vogel disc of that radius, turned by interleaved gradient noise.
THREE = "bias=front-cull,filter=pcf-disc(width=1,taps=5,plane=false)"

# BabylonJS/Babylon.js, its documentation of shadows: usePercentageCloserFiltering and a bias of 0.01, which
# shadowMapVertexMetric.fx adds to clip space, which is 2 deep. shadowsFragmentFunctions.fx, computeShadowWithPCF5: the
# default, QUALITY_HIGH. What ships before a filter is chosen, FILTER_NONE with 5e-5, has depths of 16-bit floats, which
# no format here has.
BABYLON = "bias=constant(0.005),filter=castano(5)"

# godotengine/godot. light_3d.cpp: PARAM_SHADOW_BIAS 0.1, _NORMAL_BIAS 2 texels, _BLUR 1, _PANCAKE_SIZE 20.
# ProjectSettings, directional_shadow: 16_bits, soft_shadow_filter_quality 2 (SOFT_LOW): 4 taps of a Vogel disc of
# radius 2 texels. light_storage.cpp: bias/100 · blur · that radius · bias_scale metres along the light; bias_scale is
# the depth range in metres with the pancakes' 20 (renderer_scene_cull.cpp). scene_forward_clustered.glsl, BIAS_FUNC:
# the part across the light of an offset that falls by 1 − cos θ. Left out here: farther cascades have smaller discs.
GODOT = (
    "depth=d16,bias=normal-offset(0.4714,ulps=0,falloff=across)+constant(0.002)+constant(world=0.04),"
    "filter=pcf-disc(width=2,taps=4,plane=false)"
)

# bevyengine/bevy. DirectionalLight: DEFAULT_SHADOW_DEPTH_BIAS 0.02 m, DEFAULT_SHADOW_NORMAL_BIAS 1.8, of texel
# diagonals (bevy_pbr/src/render/light.rs), at every angle (shadows.wgsl). shadow_sampling.wgsl,
# SHADOW_FILTER_METHOD_GAUSSIAN: 9 comparisons. SHADOW_FORMAT: Depth32Float.
BEVY = "bias=normal-offset(0.6,falloff=none)+constant(world=0.02),filter=castano(5)"

# google/filament. LightManager.h, ShadowOptions: mapSize 1024, constantBias 0.001 m, normalBias 1,
# polygonOffsetConstant 0.5, polygonOffsetSlope 2. ShadowMapManager.cpp: half a texel for normalBias 1; DEPTH16.
# common_shadowing.fs: it falls by sin θ. surface_shadowing.fs, SHADOW_SAMPLING_PCF_LOW: 4 comparisons. Left out here:
# the warp of a single map (lispsm).
FILAMENT = "depth=d16,bias=polygon-offset(2,0.5)+normal-offset(0.177,ulps=0)+constant(world=0.001),filter=castano(3)"

# Unity-Technologies/Graphics, URP. UniversalRenderPipelineAsset.cs: m_ShadowDepthBias 1, m_ShadowNormalBias 1, in
# texels; soft shadows are off. For those of medium quality ShadowUtils.cs, GetShadowBias, multiplies both by 2.5, and
# Shadows.hlsl takes 9 samples of a tent 5 texels wide, weights 1 3 4.5 3 1. ApplyShadowBias moves the casters, along
# their normals by 1 − cos θ; here the receivers. k_ShadowmapBufferBits: 16. A receiver plane without a gradient is a
# bias in texels.
UNITY = (
    "depth=d16,bias=normal-offset(0.589,ulps=0,falloff=versine)+receiver-plane(limit=1e-9,slack=2.5,ulps=0),"
    "filter=castano(5)"
)

ENGINES = ("babylon", "bevy", "filament", "godot", "three", "unity")
"""The engines whose parameters presets of techniques are named after."""
