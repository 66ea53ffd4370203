"""Small COLLADA, 3DXML and XAML files of one tetrahedron, placed twice."""

import io
import zipfile

POINTS = "0 0 0 1 0 0 0 1 0 0 0 1"
FACES = "0 2 1 0 1 3 0 3 2 1 2 3"
INPUT = '<input semantic="VERTEX" source="#v" offset="0"/>'
TRIANGLES = f'<triangles count="4">{INPUT}<p>{FACES}</p></triangles>'
PLACE = '<instance_geometry url="#g"/>'
SHIFT = "<matrix>1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1</matrix>"
TWO = f"<node>{PLACE}</node><node>{SHIFT}<node>{PLACE}</node></node>"


def collada(primitives=TRIANGLES, nodes=TWO, library="", head=""):
    return f"""<?xml version="1.0"?>{head}
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="s"><float_array id="a" count="12">{POINTS}</float_array><technique_common>
<accessor source="#a" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>{primitives}
</mesh></geometry></library_geometries>
<library_nodes>{library}</library_nodes>
<library_visual_scenes><visual_scene id="r">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#r"/></scene></COLLADA>
""".encode()


def archive(**parts):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as made:
        for name, content in parts.items():
            made.writestr(name, content)
    return stream.getvalue()


def threedxml(faces=f'<Face triangles="{FACES}"/>', extra="", instances=(("1", "3"), ("1", "3"))):
    placed = "".join(
        f'<Instance3D id="{10 + n}" name="p{n}"><IsAggregatedBy>{holder}</IsAggregatedBy>'
        f"<IsInstanceOf>{held}</IsInstanceOf>"
        f"<RelativeMatrix>1 0 0 0 1 0 0 0 1 {5 * n} 0 0</RelativeMatrix></Instance3D>"
        for n, (holder, held) in enumerate(instances)
    )
    structure = f"""<Model_3dxml xmlns="http://www.3ds.com/xsd/3DXML"><ProductStructure root="1">
<Reference3D id="1" name="all"/><Reference3D id="3" name="part"/>{placed}
<ReferenceRep id="4" name="shape" format="TESSELLATED" associatedFile="urn:3DXML:part.3DRep"/>
<InstanceRep id="5" name="r"><IsAggregatedBy>3</IsAggregatedBy><IsInstanceOf>4</IsInstanceOf>
</InstanceRep>{extra}</ProductStructure></Model_3dxml>"""
    shape = f"""<XMLRepresentation xmlns="http://www.3ds.com/xsd/3DXML"><Root><Rep>
<Faces>{faces}</Faces><VertexBuffer><Positions>{POINTS}</Positions><Normals>{POINTS}</Normals>
</VertexBuffer></Rep></Root></XMLRepresentation>"""
    manifest = "<Manifest><Root>all.3dxml</Root></Manifest>"
    return archive(**{"Manifest.xml": manifest, "all.3dxml": structure, "part.3DRep": shape})


def xaml(transform='<MatrixTransform3D Matrix="1 0 0 0 0 1 0 0 0 0 1 0 5 0 0 1"/>', geometry=""):
    mesh = f'<MeshGeometry3D Positions="{POINTS}" Normals="{POINTS}" TriangleIndices="{FACES}"/>'
    brush = '<SolidColorBrush Color="#FF0000" Opacity="1"/>'
    brush = f"<DiffuseMaterial.Brush>{brush}</DiffuseMaterial.Brush>"
    model = f"""<GeometryModel3D{geometry}>
<GeometryModel3D.Geometry>{mesh}</GeometryModel3D.Geometry>
<GeometryModel3D.Material><DiffuseMaterial>{brush}</DiffuseMaterial></GeometryModel3D.Material>
</GeometryModel3D>"""
    return f"""<Viewport3D xmlns="http://schemas.microsoft.com/winfx/2006/xaml/presentation">
<ModelVisual3D>{model}</ModelVisual3D><ModelVisual3D><ModelVisual3D.Transform>{transform}
</ModelVisual3D.Transform>{model}</ModelVisual3D></Viewport3D>""".encode()
