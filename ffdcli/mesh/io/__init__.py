"""Mesh files: one module per format, with its decoder and its encoder.

To add a format, write a module with ``decode_NAME(data, path)``, which returns a `RawMesh`, or
``encode_NAME(mesh, path)``, which takes a `PaintedMesh`, or both; enter them in `read.DECODERS` and
`write.ENCODERS`; and describe a format that is written in `ffdcli.formats.MESH_FORMATS`.
"""
