"""USD: what is drawn of a stage, where, and in which unit."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, UsdUtils, Vt

from shadowbench.errors import InputError
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.meshes import read_meshes
from shadowbench.scenes.model import Scene
from shadowbench.scenes.usd_stage import read_stage
from tests.scenes.conftest import refused

Read = Callable[..., Scene]
pytestmark = pytest.mark.usefixtures("here")


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stages are read in this process, as another takes a second to start."""

    def answer(module: str, seconds: float, where: str, path: np.ndarray) -> list[np.ndarray]:
        try:
            return list(read_stage(path))
        except InputError as error:
            raise InputError(f"{where}: {error}") from error

    monkeypatch.setattr("shadowbench.scenes.usd.decoded_apart", answer)


QUAD = """
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
"""


@pytest.fixture
def written(tmp_path: Path) -> Callable[..., Path]:
    """Writes a .usda in metres with y up."""

    def write(body: str, head: str = 'upAxis = "Y"\nmetersPerUnit = 1', name: str = "model.usda") -> Path:
        path = tmp_path / name
        spaced = body.replace("; ", "\n").replace("{ ", "{\n").replace(" }", "\n}")
        path.write_text(f"#usda 1.0\n(\n{head}\n)\n{spaced}")
        return path

    return write


@pytest.fixture
def read(written: Callable[..., Path]) -> Read:
    return lambda *arguments: read_meshes(written(*arguments))


def corners(scene: Scene, number: int = 0) -> list[list[float]]:
    """Sorted positions of a mesh's vertices."""
    return sorted(scene.meshes[number].vertices.round(6).tolist())


def normal(scene: Scene, number: int = 0) -> np.ndarray:
    mesh = scene.meshes[number]
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a).sum(axis=0)


@pytest.mark.parametrize(
    ("head", "expected"),
    [
        ('upAxis = "Y"\nmetersPerUnit = 1', [[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]]),
        ('upAxis = "Z"\nmetersPerUnit = 0.5', [[0, 0, -0.5], [0, 0, 0], [0.5, 0, -0.5], [0.5, 0, 0]]),
        ("metersPerUnit = 2", [[0, 0, 0], [0, 2, 0], [2, 0, 0], [2, 2, 0]]),
    ],
)
def test_vertices_are_in_metres_with_y_up(read: Read, head: str, expected: list[list[float]]) -> None:
    scene = read('def Mesh "quad" {' + QUAD + "}", head)
    assert corners(scene) == expected and [mesh.name for mesh in scene.meshes] == ["quad"]
    assert len(scene.meshes[0].faces) == 2 and not scene.notes
    turned = np.array([0, 1, 0]) if "Z" in head else np.array([0, 0, 1])
    assert normal(scene) @ turned > 0


def test_an_unknown_unit_is_a_centimetre_and_a_note(read: Read) -> None:
    scene = read('def Mesh "quad" {' + QUAD + "}", 'upAxis = "Y"')
    assert corners(scene)[-1] == [0.01, 0.01, 0]
    assert scene.notes == ("model.usda: 1 unit assumed, of 0.01 m as in USD without metersPerUnit",)


def test_transforms_follow_the_tree_unless_reset(read: Read) -> None:
    scale = "float3 xformOp:scale = (2, 2, 2)\ndouble3 xformOp:translate = (0, 0, 3)\n"
    reset = 'uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:translate"]\n'
    moved = "double3 xformOp:translate = (0, 0, 1)\n"
    body = (
        f'def Xform "a" {{ {scale} uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]\n'
        f'def Mesh "below" {{ {QUAD} }}\ndef Mesh "reset" {{ {QUAD} ; {moved} {reset} }} }}'
    )
    scene = read(body)
    assert corners(scene, 0)[-1] == [2, 2, 3]
    assert corners(scene, 1)[-1] == [1, 1, 1]


def test_what_is_not_drawn_is_left_out_with_a_note(read: Read) -> None:
    hidden = 'token visibility = "invisible"\n'
    scene = read(
        f'def Mesh "seen" {{ {QUAD} }}\n'
        f'def Xform "hidden" {{ {hidden} def Mesh "a" {{ {QUAD} }}; def SphereLight "l" {{}} }}\n'
        f'def Mesh "guide" {{ {QUAD} uniform token purpose = "guide" }}\n'
        f'def Xform "proxies" {{ uniform token purpose = "proxy"\n def Mesh "p" {{ {QUAD} }}\n'
        f'  def Mesh "r" {{ {QUAD} uniform token purpose = "render" }} }}\n'
        f'class Mesh "abstract" {{ {QUAD} }}\n'
        f'def BasisCurves "hair" {{}}\n def DomeLight "sky" {{}}\n'
    )
    assert [mesh.name for mesh in scene.meshes] == ["seen", "r"] and not scene.lights
    assert {note.partition(": ")[2] for note in scene.notes} == {
        "1 mesh(es) of hidden prims left out", "1 light(s) of hidden prims left out",
        "1 prim(s) of the purpose guide left out", "1 prim(s) of the purpose proxy left out",
        "1 prim(s) of the kind BasisCurves left out: meshes, cubes and such are drawn",
        "1 light(s) of the kind DomeLight left out",
    }  # fmt: skip


def test_faces_that_are_holes_are_not_drawn_and_left_handed_ones_turn(read: Read) -> None:
    two = QUAD.replace("[4]", "[3, 3]").replace("[0, 1, 2, 3]", "[0, 1, 2, 0, 2, 3]")
    scene = read(
        f'def Mesh "a" {{ {two} int[] holeIndices = [0] }}\n'
        f'def Mesh "b" {{ {QUAD} uniform token orientation = "leftHanded" }}\n'
    )
    assert corners(scene, 0) == [[0, 0, 0], [0, 1, 0], [1, 1, 0]]
    assert normal(scene, 0)[2] > 0 > normal(scene, 1)[2]


@pytest.mark.parametrize(
    ("solid", "extent", "triangles"),
    [
        ('Cube "c" { double size = 3 }', [3, 3, 3], 12),
        ('Sphere "c" { double radius = 2 }', [4, 4, 4], 5120),
        ('Cylinder "c" { double radius = 2; double height = 3; uniform token axis = "X" }', [3, 4, 4], 256),
        ('Cone "c" { double radius = 2; double height = 5 }', [4, 4, 5], 128),
        ('Plane "c" { double width = 2; double length = 5; uniform token axis = "Y" }', [2, 0, 5], 2),
        ('Plane "c" { double width = 2; double length = 5; uniform token axis = "X" }', [0, 5, 2], 2),
    ],
)
def test_solids_have_their_sizes(read: Read, solid: str, extent: list[float], triangles: int) -> None:
    (mesh,) = read(f"def {solid}").meshes
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx(extent)
    assert len(mesh.faces) == triangles
    if "Plane" in solid:
        assert normal(read(f"def {solid}"))["XYZ".index(solid[-4])] > 0


def instancer(more: str = "", prototype: str = f'def Mesh "proto" {{ {QUAD} }}') -> str:
    return f"""def PointInstancer "trees" {{
        double3 xformOp:translate = (0, 0, 10)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        rel prototypes = [</trees/proto>]
        int[] protoIndices = [0, 0, 0]
        point3f[] positions = [(0, 0, 0), (5, 0, 0), (0, 7, 0)]
        quath[] orientations = [(1, 0, 0, 0), (0.7071, 0, 0, 0.7071), (1, 0, 0, 0)]
        float3[] scales = [(1, 1, 1), (2, 2, 2), (1, 1, 1)]
        {more}
        {prototype}
    }}"""


def test_a_point_instancer_draws_its_prototype_at_each_unmasked_place_and_nowhere_else(read: Read) -> None:
    scene = read(instancer())
    assert [mesh.name for mesh in scene.meshes] == ["proto 1", "proto 2", "proto 3"]
    assert corners(scene, 0)[-1] == [1, 1, 10]
    assert scene.meshes[1].vertices.min(axis=0) == pytest.approx([3, 0, 10], abs=1e-3)  # turned by 90° about z
    assert corners(scene, 2)[0] == [0, 7, 10]
    masked = read(instancer("int64[] invisibleIds = [1]"))
    assert [mesh.name for mesh in masked.meshes] == ["proto 1", "proto 3"]


def test_a_prototype_may_itself_be_instances(read: Read) -> None:
    scene = read(f"""def PointInstancer "outer" {{
        rel prototypes = [</outer/group>]
        int[] protoIndices = [0, 0]
        point3f[] positions = [(100, 0, 0), (200, 0, 0)]
        def Xform "group" {{ {instancer().replace("/trees", "/outer/group/trees")} }}
    }}""")
    assert [mesh.name for mesh in scene.meshes] == [f"proto {k} {n}" for n in (1, 2) for k in (1, 2, 3)]
    assert corners(scene, 3)[0] == [200, 0, 10]


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (instancer().replace("[0, 0, 0]\n", "[0, 0, 7]\n", 1), ["/trees", "prototype 7", "of 1"]),
        (instancer().replace("(5, 0, 0), ", ""), ["/trees", "3 instances, but 0 transforms"]),
        (instancer().replace("</trees/proto>", "</trees>"), ["/trees", "prototype of itself"]),
        (instancer().replace("</trees/proto>", "</nowhere>"), ["/nowhere is no prim"]),
        ('def Mesh "m" {' + QUAD.replace("[4]", "[5]") + "}", ["/m: faceVertexCounts sum to 5; needed are the 4"]),
        ('def Mesh "m" {' + QUAD.replace("[4]", "[5, -1]") + "}", ["/m", "sum to 4"]),
        ('def Mesh "m" {' + QUAD.replace("2, 3]", "2, 4]") + "}", ["/m", "uses vertex 4"]),
        ('def Mesh "m" {' + QUAD.replace("(1, 1, 0)", "(1, inf, 0)") + "}", ["inf"]),
        ('def "a" { int b = }', ["'model.usda' is not USD"]),
        ('def Mesh "m" (references = @../b.usda@) {}', ["'../b.usda' leads outside its folder"]),
        ('def "m" (variants = { string v = "a" }; prepend variantSets = "v") { variantSet "v" = { "a" { '
         'def "n" (references = @../c.usda@) {} } } }', ["'../c.usda' leads outside"]),
        ('def Mesh "m" (payload = @/etc/b.usda@) {}', ["'/etc/b.usda' leads outside"]),
        ('def Mesh "m" (references = @./b.usda@) {}', ["'./b.usda' is not a file in its folder"]),
        ('def Mesh "m" (references = @https://a.b/c.usda@) {}', ["is not a file in its folder"]),
        ('def Mesh "m" ( clips = { dictionary default = { asset[] assetPaths = [@/etc/a.usd@] } } ) {' + QUAD + "}",
         ["/m: value clips are not supported"]),
        ('def RectLight "l" { float inputs:width = -1 }; def Cube "c" {}', ["light l", "size"]),
        ('def Camera "c" { float3 xformOp:scale = (0, 0, 0)\n uniform token[] xformOpOrder = ["xformOp:scale"] }',
         ["/c: its transform is singular"]),
        ('def Xform "x" {}', ["no triangles"]),
    ],
)  # fmt: skip
def test_an_invalid_file_is_one_line(written: Callable[..., Path], body: str, words: list[str]) -> None:
    refused(written(body), "model.usda", *words)


def test_an_invalid_unit_is_one_line(written: Callable[..., Path]) -> None:
    refused(written('def Cube "c" {}', "metersPerUnit = 0"), "metersPerUnit is 0; allowed: above 0")


def test_a_chain_of_links_out_of_the_folder_is_not_followed(written: Callable[..., Path], tmp_path: Path) -> None:
    outside = tmp_path.parent / f"{tmp_path.name}-outside.usda"
    outside.write_text('#usda 1.0\ndef Cube "c" {}')
    (tmp_path / "link.usda").symlink_to(outside)
    written("", "subLayers = [@link.usda@]", "inner.usda")
    refused(written("", "subLayers = [@inner.usda@]"), "'link.usda' leads outside")


def test_files_of_its_folder_are_composed_packed_or_not(written: Callable[..., Path], tmp_path: Path) -> None:
    written('def Mesh "quad" {' + QUAD + "}", 'defaultPrim = "quad"', "part.usda")
    path = written('def Mesh "mine" (references = @part.usda@) {}')
    expected = corners(read_meshes(path))
    Usd.Stage.Open(str(path)).Export(str(tmp_path / "flat.usdc"))
    assert UsdUtils.CreateNewUsdzPackage(str(path), str(tmp_path / "packed.usdz"))
    for name in ("flat.usdc", "packed.usdz"):
        assert corners(read_meshes(tmp_path / name)) == expected, name


def test_a_camera_keeps_its_lens_and_place(read: Read) -> None:
    body = """def Camera "cam" {
        float focalLength = 20
        float verticalAperture = 20
        float2 clippingRange = (0.5, 100)
        double3 xformOp:translate = (1, 2, 3)
        uniform token[] xformOpOrder = ["xformOp:translate"] }
        def Camera "flat" { token projection = "orthographic" }
        """
    scene = read(body + 'def Cube "c" {}', 'upAxis = "Z"\nmetersPerUnit = 0.1')
    (camera,) = scene.cameras
    assert (camera.name, camera.position) == ("cam", pytest.approx((0.1, 0.3, -0.2)))
    assert camera.fov_y == pytest.approx(2 * math.atan(0.5))
    assert camera.basis() == pytest.approx(np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]))  # looks down, along −z there
    assert (camera.near, camera.far) == pytest.approx((0.05, 10))
    assert "model.usda: 1 orthographic camera(s) left out: cameras here are perspective" in scene.notes


def test_lights_keep_their_sizes_in_metres(read: Read) -> None:
    turned = 'float xformOp:rotateX = -90\nuniform token[] xformOpOrder = ["xformOp:rotateX"]\n'
    body = f"""
        def DistantLight "sun" {{ float inputs:angle = 2; {turned} }}
        def SphereLight "bulb" {{ float inputs:radius = 3 }}
        def SphereLight "dot" {{ float inputs:radius = 3; bool treatAsPoint = 1 }}
        def SphereLight "spot" (apiSchemas = ["ShapingAPI"]) {{
            float inputs:radius = 1; float inputs:shaping:cone:angle = 30 }}
        def DiskLight "disc" {{ float inputs:radius = 4; float inputs:intensity = 0 }}
        def RectLight "panel" {{ float inputs:width = 2; float inputs:height = 6; {turned} }}
        def Cube "c" {{}}"""
    scene = read(body, 'upAxis = "Y"\nmetersPerUnit = 0.5')
    sun, bulb, dot, spot, disc, panel = scene.lights
    assert (sun.kind, sun.radius, sun.direction) == (
        "directional",
        pytest.approx(math.radians(1)),
        pytest.approx((0, -1, 0)),
    )
    assert (bulb.kind, bulb.radius, dot.radius) == ("point", 1.5, 0.0)
    assert (spot.kind, spot.radius, spot.angle) == ("spot", 0.5, pytest.approx(math.radians(60)))
    assert (disc.kind, disc.radius, disc.direction) == ("disc", 2.0, (0, 0, -1))
    assert (panel.kind, panel.size) == ("rectangle", pytest.approx((1.0, 3.0)))
    assert panel.direction == pytest.approx((0, -1, 0)) and panel.up == pytest.approx((0, 0, -1))
    assert any("intensity 0" in note for note in scene.notes)


def test_lights_of_usd_have_sizes_so_that_no_note_says_hard(written: Callable[..., Path]) -> None:
    scene = load_scene(written('def SphereLight "l" { double3 xformOp:translate = (0, 5, 0)\n'
                               'uniform token[] xformOpOrder = ["xformOp:translate"] }; def Cube "c" {}'))  # fmt: skip
    assert scene.lights[0].soft and not any("hard" in note for note in scene.notes)


def test_colours_are_the_materials_or_the_prims_own(read: Read) -> None:
    body = f"""def Mesh "a" {{ {QUAD}; color3f[] primvars:displayColor = [(0.1, 0.2, 2)] }}
        def Mesh "b" (apiSchemas = ["MaterialBindingAPI"]) {{ {QUAD} ; rel material:binding = </m> }}
        def Material "m" {{ token outputs:surface.connect = </m/s.outputs:surface>
            def Shader "s" {{ uniform token info:id = "UsdPreviewSurface"; color3f inputs:diffuseColor = (0.5, 0, 1)
                float inputs:opacity = 0.5; token outputs:surface }} }}"""
    scene = read(body)
    assert [mesh.color for mesh in scene.meshes] == [pytest.approx((0.1, 0.2, 1)), (0.5, 0, 1)]
    assert scene.notes == ("model.usda: 1 see-through mesh(es) drawn opaque",)


def test_a_skin_is_drawn_as_its_joints_stand(tmp_path: Path) -> None:
    path = tmp_path / "skin.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetStartTimeCode(5)
    stage.SetEndTimeCode(6)
    UsdSkel.Root.Define(stage, "/r")
    skeleton = UsdSkel.Skeleton.Define(stage, "/r/s")
    skeleton.CreateJointsAttr(["j"])
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d(1)])
    skeleton.CreateRestTransformsAttr([Gf.Matrix4d(1)])
    animation = UsdSkel.Animation.Define(stage, "/r/a")
    animation.CreateJointsAttr(["j"])
    animation.CreateTranslationsAttr().Set(Vt.Vec3fArray([Gf.Vec3f(0, 0, 7)]), 5)
    animation.CreateRotationsAttr([Gf.Quatf(1)])
    animation.CreateScalesAttr([Gf.Vec3h(1, 1, 1)])
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().AddTarget("/r/a")
    mesh = UsdGeom.Mesh.Define(stage, "/r/m")
    mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    mesh.CreateFaceVertexCountsAttr([3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
    mesh.CreateSubdivisionSchemeAttr("none")
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().AddTarget("/r/s")
    binding.CreateJointIndicesPrimvar(False, 1).Set(Vt.IntArray([0, 0, 0]))
    binding.CreateJointWeightsPrimvar(False, 1).Set(Vt.FloatArray([1, 1, 1]))
    stage.Save()
    (moved,) = read_meshes(path).meshes
    assert (moved.vertices[:, 2] == 7).all()
    assert Sdf.Layer.FindOrOpen(str(path)).ExportToString() == path.read_text()  # which stays as it is


def test_without_the_extra_a_line_says_how_to_get_it(
    written: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shadowbench.scenes.usd.find_spec", lambda name: None)
    refused(written('def Cube "c" {}'), "model.usda", "usd-core", "pip install '.[usd]'")
