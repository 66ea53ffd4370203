"""Counts of COLLADA, 3DXML and XAML files.

trimesh reads these files. It leaves out, without a word, what it does not know, so what it returns
is compared with these counts, which are made before it reads.
"""

from __future__ import annotations

from pathlib import Path
from xml.parsers import expat

from ffdcli.errors import FileError
from ffdcli.mesh.io.threemf.package import open_package, plain_text
from ffdcli.mesh.io.xml_scenes.collada import count_collada, root_of_zae
from ffdcli.mesh.io.xml_scenes.tally import Refused, SceneCounts, parse_part, parse_xml
from ffdcli.mesh.io.xml_scenes.threedxml import count_3dxml
from ffdcli.mesh.io.xml_scenes.xaml import count_xaml


def count_scene(data: bytes, path: Path) -> SceneCounts:
    """What a file places in its scene.

    Raises
    ------
    FileError
        The XML is damaged or defines entities, names what it does not hold, places something in
        itself, or holds what the reader of this format does not know: then that is named.
    """
    suffix = path.suffix.lower()
    try:
        if suffix == ".dae":
            return count_collada(parse_xml(data))
        if suffix == ".xaml":
            return count_xaml(parse_xml(data))
        package = open_package(data, str(path))
        # The reader unpacks all parts.
        size = 0
        for part in package.entries:
            size = package.check(part, size)
        if suffix == ".zae":
            return count_collada(parse_part(package, root_of_zae(package)))
        return count_3dxml(package)
    except Refused as error:
        raise FileError(str(error), file=str(path), hint=error.hint) from None
    except (expat.ExpatError, LookupError, ValueError) as error:
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise FileError(
            f"the file cannot be read as {suffix}: {plain_text(reason)}",
            file=str(path),
            hint="export it again, as triangles or in another format such as .obj",
        ) from error
