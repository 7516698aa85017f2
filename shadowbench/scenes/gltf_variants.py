"""Variants of a glTF's materials by name: KHR_materials_variants."""

from shadowbench.errors import NotInFile, alternatives
from shadowbench.scenes.gltf_layout import Layout, Primitive


def with_variant(layout: Layout, name: str | None, where: str) -> Layout:
    """The layout whose primitives have their materials of a variant; None: the file's own.

    A primitive that the variant does not name keeps its own. Raises InputError for an unknown name.
    """
    if name is None:
        return layout
    names = [each.name for each in layout.variants]
    if name not in names:
        raise NotInFile(
            f"{where}: variant: found {name!r:.60}{alternatives(name, names, none='no variant, as the file has none')}"
        )
    number = names.index(name)
    meshes = [
        mesh.model_copy(update={"primitives": [_dressed(each, number) for each in mesh.primitives]})
        for mesh in layout.meshes
    ]
    return layout.model_copy(update={"meshes": meshes})


def variant_notes(layout: Layout, name: str | None, where: str) -> list[str]:
    """The note which variant was taken, if the file has any."""
    if not layout.variants:
        return []
    taken = "the file's own materials" if name is None else f"variant {name!r:.60}"
    names = ", ".join(f"{each.name:.40}" for each in layout.variants[:10]) + ", ..." * (len(layout.variants) > 10)
    return [f"{where}: {taken} taken; variant chooses of {names}"]


def _dressed(primitive: Primitive, number: int) -> Primitive:
    found = [mapping.material for mapping in primitive.variants if number in mapping.variants]
    return primitive.model_copy(update={"material": found[0]}) if found else primitive
