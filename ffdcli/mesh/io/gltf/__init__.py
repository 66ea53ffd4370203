"""glTF 2.0 files (.gltf, .glb), decoded by the standard's words and encoded by trimesh.

"The standard" is the Khronos glTF 2.0 specification (ISO/IEC 12113); extensions are those of its
registry.
"""
