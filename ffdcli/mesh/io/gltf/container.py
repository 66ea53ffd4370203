"""The outer form of a glTF file: its JSON, its binary part, and the extensions it requires."""

from __future__ import annotations

from ffdcli.mesh.io.gltf.entries import Entry, Unreadable, parse_entry

DRACO = "KHR_draco_mesh_compression"
INSTANCING = "EXT_mesh_gpu_instancing"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
TEXTURE_TRANSFORM = "KHR_texture_transform"

# Extensions that change shapes or texture coordinates, and are applied.
_APPLIED = {DRACO, INSTANCING, *MESHOPT, TEXTURE_TRANSFORM, "KHR_mesh_quantization"}
# Extensions that change neither: lights, images, metadata, motion. Those of materials begin alike.
_MATERIALS = "KHR_materials_"
_WITHOUT_SHAPE = {
    "EXT_feature_metadata",
    "EXT_instance_features",
    "EXT_lights_ies",
    "EXT_lights_image_based",
    "EXT_mesh_features",
    "EXT_structural_metadata",
    "EXT_texture_avif",
    "EXT_texture_webp",
    "KHR_node_visibility",
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_technique_webgl",
    "KHR_techniques_webgl",
    "KHR_texture_basisu",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_texture_dds",
}
_HEADER, _CHUNK = 12, 8
_JSON, _BINARY = 0x4E4F534A, 0x004E4942


def open_container(data: bytes) -> tuple[Entry, memoryview | None]:
    """The root of a file, checked for version and extensions, and its binary part or None.

    Raises
    ------
    Unreadable
        The file is damaged, cut short, or of another version, or requires an unknown extension.
    """
    text, binary = _chunks(data) if data[:4] == b"glTF" else (data, None)
    if text.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] != b"{":
        raise Unreadable("it is neither binary glTF nor JSON")
    root = parse_entry(text)
    _require_version(root.entry("asset"))
    for name in root.texts("extensionsRequired"):
        if name not in _APPLIED | _WITHOUT_SHAPE and not name.startswith(_MATERIALS):
            raise Unreadable(
                f"it requires the extension {name!r}, which is not known here",
                "export it without this extension, or in another format such as .obj",
            )
    return root, binary


def requires(root: Entry, *names: str) -> bool:
    """Whether a file cannot be read without one of these extensions."""
    return not set(names).isdisjoint(root.texts("extensionsRequired"))


def _chunks(data: bytes) -> tuple[bytes, memoryview | None]:
    """JSON and binary part of binary glTF."""
    version, promised = (int.from_bytes(data[at : at + 4], "little") for at in (4, 8))
    if len(data) < _HEADER + _CHUNK:
        raise Unreadable(f"it is cut short: it has {len(data)} bytes")
    if version != 2:
        raise Unreadable(f"it is binary glTF of version {version}", "convert it to glTF 2.0")
    if promised > len(data):
        raise Unreadable(
            f"it is cut short: the header promises {promised} bytes, the file has {len(data)}"
        )
    view, at = memoryview(data)[:promised], _HEADER
    chunks: list[tuple[int, memoryview]] = []
    while at + _CHUNK <= promised:
        length, kind = (int.from_bytes(view[at + n : at + n + 4], "little") for n in (0, 4))
        at += _CHUNK
        if length > promised - at:
            raise Unreadable(
                f"part {len(chunks)} (counted from 0) promises {length} bytes, "
                f"but only {promised - at} follow"
            )
        chunks.append((kind, view[at : at + length]))
        at += length
    if not chunks or chunks[0][0] != _JSON:
        raise Unreadable("its first part is not JSON")
    # Parts of other kinds are to be ignored.
    binary = chunks[1][1] if len(chunks) > 1 and chunks[1][0] == _BINARY else None
    return bytes(chunks[0][1]), binary


def _require_version(asset: Entry) -> None:
    for key in ("version", "minVersion"):
        # Version 1 states a number or nothing, and has objects in place of lists.
        stated = asset.values.get(key, "2.0")
        if not isinstance(stated, str | int | float):
            asset.reject(key, "a version")
        major, _, minor = str(stated).partition(".")
        if major != "2" or (key == "minVersion" and minor != "0"):
            raise Unreadable(f"it is glTF of version {str(stated)[:9]!r}", "convert it to glTF 2.0")
