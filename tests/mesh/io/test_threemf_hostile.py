"""3MF files that lie, multiply or are damaged: refused in one sentence, before they cost much."""

import io
import zipfile

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.errors import FileError
from ffdcli.mesh import inspect, read_mesh
from ffdcli.mesh.io.threemf.package import MOST_BYTES
from support.damage import BITS, damage, require_read_or_refused
from support.threemf_files import ROOT, assembly, box, matrix, model, relations, save, thing

PLAIN = model(thing(1), 'objectid="1"')


def message_of(path):
    with pytest.raises(FileError) as caught:
        read_mesh(path)
    assert caught.value.hint
    assert str(caught.value).isprintable()
    return caught.value.message


def with_size(path, name, size):
    """The archive, whose directory states another size of a member."""
    data = bytearray(path.read_bytes())
    at = data.rindex(b"PK\x01\x02", 0, data.rindex(name.encode()))
    data[at + 24 : at + 28] = size.to_bytes(4, "little")
    path.write_bytes(data)
    return path


def test_sizes_are_checked_before_anything_is_unpacked(tmp_path):
    path = with_size(save(tmp_path / "a.3mf", PLAIN), ROOT, 2**32 - 2)
    assert f"unpacks to {2**32 - 2} bytes; at most {MOST_BYTES}" in message_of(path)
    # Blanks of 70 MB in 70 kB.
    text = PLAIN.replace("<resources>", "<resources>" + " " * 70_000_000)
    path = save(tmp_path / "b.3mf", text, packing=zipfile.ZIP_DEFLATED)
    assert "which no mesh does" in message_of(path)
    # Each part is small, all together are not.
    item = 'p:path="/3D/{}.model" objectid="1"'
    parts = {f"3D/{n}.model": model(thing(1)) for n in range(9)}
    path = save(tmp_path / "c.3mf", model("", *[item.format(n) for n in range(9)]), parts)
    for name in parts:
        with_size(path, name, MOST_BYTES // 8)
    assert "no mesh does" in message_of(path) or "at most" in message_of(path)


def test_what_is_unpacked_ends_at_the_stated_size(tmp_path):
    path = save(tmp_path / "a.3mf", PLAIN + " " * 10_000_000, packing=zipfile.ZIP_DEFLATED)
    assert "cannot be read as .3mf" in message_of(with_size(path, ROOT, len(PLAIN)))


def test_archives_that_cannot_be_read(tmp_path):
    path = save(tmp_path / "a.3mf", PLAIN)
    whole = path.read_bytes()
    path.write_bytes(whole[:-30])
    assert "cannot be read as .3mf: it is no whole zip archive" in message_of(path)
    at = whole.index(b"<model")
    path.write_bytes(whole[:at] + b"<Model" + whole[at + 6 :])
    assert "Bad CRC-32" in message_of(path)
    path = save(tmp_path / "b.3mf", PLAIN, packing=zipfile.ZIP_LZMA)
    assert "unknown method 14" in message_of(path)
    data = bytearray(whole)
    data[data.rindex(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(data)
    assert "encrypted" in message_of(path)
    path = tmp_path / "c.3mf"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("_rels/.rels", relations("/" + ROOT))
        archive.writestr(ROOT, PLAIN)
        archive.writestr("3D/3dmodel.modeL", PLAIN)
    path.write_bytes(path.read_bytes().replace(b"3dmodel.modeL", b"3dmodel.model"))
    assert f"2 parts of the name '{ROOT}'" in message_of(path)


def test_entities_and_document_types(tmp_path):
    laughs = "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 20}">' for n in range(1, 20))
    for subset in (f'[<!ENTITY l0 "ha">{laughs}]', 'SYSTEM "file:///etc/passwd"', "[]"):
        text = PLAIN.replace("<model", f"<!DOCTYPE model {subset}><model", 1)
        text = text.replace('id="1"', 'id="1" name="&l19;"', 1)
        path = save(tmp_path / "a.3mf", text)
        assert "document type" in message_of(path)
        path = save(tmp_path / "a.3mf", PLAIN, {"_rels/.rels": text})
        assert "document type" in message_of(path)
    message = message_of(save(tmp_path / "a.3mf", PLAIN.replace('id="1"', 'id="&l9;"', 1)))
    assert "cannot be read as .3mf: part '3D/3dmodel.model'" in message


def test_depth_is_bounded(tmp_path):
    deep = PLAIN.replace("<resources>", "<resources>" + "<a>" * 10**5 + "</a>" * 10**5)
    assert "too deep" in message_of(save(tmp_path / "a.3mf", deep))
    assert "10000 elements" in message_of(save(tmp_path / "a.3mf", PLAIN, {"_rels/.rels": deep}))
    # A chain of assemblies, each in the next.
    count = 3000
    chain = "".join(assembly(n + 1, f'objectid="{n}"') for n in range(1, count))
    path = save(tmp_path / "b.3mf", model(thing(1) + chain, f'objectid="{count}"'))
    assert inspect(read_mesh(path)).bodies == 1


def test_copies_of_copies_are_counted_before_they_are_made(tmp_path):
    twice = "".join(assembly(n + 1, *[f'objectid="{n}"'] * 2) for n in range(1, 200))
    path = save(tmp_path / "a.3mf", model(thing(1) + twice, 'objectid="200"'))
    assert "at most 1000000 are read" in message_of(path)
    many = "".join(assembly(n + 1, *[f'objectid="{n}"'] * 100) for n in range(1, 3))
    spread = f'objectid="3" {matrix()}', f'objectid="3" {matrix(by=(50, 0, 0))}'
    path = save(tmp_path / "b.3mf", model(thing(1, box()) + many, *spread * 45))
    # 90 × 100 × 100 boxes of 12 triangles.
    assert f"{90 * 100 * 100 * 12} in all" in message_of(path)


@pytest.mark.parametrize(
    ("entry", "count"),
    [
        ('<object id="9{}"/>', 1),
        ('<basematerials id="9{}"/>', 1),
        ('<basematerials id="9{}"><base/><base/></basematerials>', 3),
        ('<object id="9{}"><components><component objectid="1"/></components></object>', 2),
    ],
)
def test_many_small_entries(tmp_path, monkeypatch, entry, count):
    """They are counted over all parts, before each takes its kilobytes."""
    monkeypatch.setattr("ffdcli.mesh.io.threemf.model.MOST_ENTRIES", 60)
    item = 'objectid="1" p:path="/3D/b.model"'
    for number, fits in ((28 // count, True), (30 // count, False)):
        many = thing(1) + "".join(map(entry.format, range(number)))
        path = save(tmp_path / "a.3mf", model(many, item), {"3D/b.model": model(many)})
        if fits:
            assert read_mesh(path).polygon_count == 12
        else:
            assert "more than 60 objects" in message_of(path)
    path = save(tmp_path / "a.3mf", model(thing(1), *['objectid="1"'] * 60))
    assert "more than 60 objects" in message_of(path)


def test_nothing_outside_of_the_file_is_read(tmp_path):
    (tmp_path / "o.model").write_text(model(thing(1)))
    for path in ("../o.model", f"{tmp_path}/o.model", f"file://{tmp_path}/o.model", "http://a/b"):
        text = model("", f'objectid="1" p:path="{path}"')
        assert "which the file does not have" in message_of(save(tmp_path / "a.3mf", text))


def test_what_reaches_a_terminal_is_printable(tmp_path):
    evil = "&#x9b;31m&#x202e;&#10;"
    texts = [
        model(thing(1), f'objectid="{evil}"'),
        model("", f'objectid="1" p:path="{evil}"'),
        model(thing(1), 'objectid="1"', stated=f'requiredextensions="{evil}x"'),
        model(thing(evil, box().replace('v1="0"', 'v1="9"')), f'objectid="{evil}"'),
        model(thing(1, box().replace('x="0"', f'x="{evil}"')), 'objectid="1"'),
        model(thing(1), f'objectid="1" transform="{evil}"'),
        model(thing(1, stated=f'type="support" name="{evil}"'), 'objectid="1"'),
        "<" + "b" * 5000 + "/>",
        "<a b='\x01'/>",
    ]
    for text in texts:
        assert len(message_of(save(tmp_path / "a.3mf", text))) < 400
    unit = model(thing(evil, "<mesh/>") + thing(2), f'objectid="{evil}"', 'objectid="2"')
    mesh = read_mesh(save(tmp_path / "a.3mf", unit.replace("millimeter", evil)))
    assert len(mesh.notes) == 2
    assert all(note.isprintable() for note in mesh.notes)


OTHER = "3D/b.model"
GOOD = {
    "root": model(
        '<basematerials id="5"><base name="a" displaycolor="#808080"/></basematerials>'
        + thing(1, box(paint=['pid="5" p1="0"']), 'name="one" type="model" pid="5" pindex="0"')
        + assembly(2, f'objectid="1" {matrix(by=(50, 0, 0))}', f'p:path="/{OTHER}" objectid="1"'),
        'objectid="1" partnumber="P"',
        f'objectid="2" {matrix(((-1, 0, 0), (0, 1, 0), (0, 0, 1)), (0, 90, 0))}',
        stated='requiredextensions="p"',
    ),
    "other": model(thing(1, box((1, 2, 3)))),
    "relations": relations("/" + ROOT),
}
# What XML turns into when it is mangled.
MARKS = (*BITS, b"<", b">", b'"', b"&", b"/>", b"</object>", b"<!--", b"\xff", b"\xc3\xa9", b"p:")


@settings(max_examples=150)
@given(data=st.data())
def test_damaged_xml(tmp_path_factory, data):
    texts = {name: text.encode() for name, text in GOOD.items()}
    name = data.draw(st.sampled_from(list(texts)))
    texts[name] = damage(texts[name], data, MARKS)
    path = tmp_path_factory.getbasetemp() / "xml.3mf"
    save(path, texts["root"], {OTHER: texts["other"], "_rels/.rels": texts["relations"]})
    require_read_or_refused(path)


@settings(max_examples=80)
@given(data=st.data())
def test_damaged_archives(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "zip.3mf"
    packing = data.draw(st.sampled_from([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED]))
    save(path, GOOD["root"], {OTHER: GOOD["other"]}, packing=packing)
    path.write_bytes(damage(path.read_bytes(), data))
    require_read_or_refused(path)


@settings(max_examples=40)
@given(data=st.data())
def test_members_dropped_renamed_and_doubled(tmp_path_factory, data):
    out = io.BytesIO()
    members = [("_rels/.rels", "relations"), (ROOT, "root"), (OTHER, "other")]
    with zipfile.ZipFile(out, "w") as archive:
        for name, text in data.draw(st.permutations(members)):
            do = data.draw(st.sampled_from(["keep", "keep", "drop", "rename", "swap", "directory"]))
            if do == "rename":
                name = data.draw(st.sampled_from([name.upper(), "/" + name, name + "x", ".."]))
            elif do == "swap":
                text = data.draw(st.sampled_from(list(GOOD)))
            if do == "directory":
                archive.writestr(name + "/", "")
            elif do != "drop":
                archive.writestr(name, GOOD[text])
    path = tmp_path_factory.getbasetemp() / "members.3mf"
    path.write_bytes(out.getvalue())
    require_read_or_refused(path)
