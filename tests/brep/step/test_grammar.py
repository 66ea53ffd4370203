"""The grammar of Part 21, by a strict parser of another project (IfcOpenShell's, in Lark)."""

import pytest

from ffdcli.brep.occ.formats import SCHEMAS
from ffdcli.brep.step.write import write_step
from support import brep_models as models

simple_spf = pytest.importorskip("ifcopenshell.simple_spf")


@pytest.fixture(scope="module")
def texts(tmp_path_factory):
    folder, found = tmp_path_factory.mktemp("step"), {}
    brep = models.grid_of_cubes(2, lambda points: 1e-9 * models.projective(points), 4)
    for schema in SCHEMAS:
        path = folder / f"{schema}.step"
        write_step(brep, path, labels=models.labelled(2), schema=schema, unit="inch")
        found[schema] = path.read_text()
    return found


@pytest.mark.parametrize("schema", SCHEMAS)
def test_files_follow_the_grammar(texts, schema):
    assert "E-" in texts[schema]
    simple_spf.parse(filecontent=texts[schema], with_tree=False)


@pytest.mark.parametrize(
    ("old", "new"), [("(0.,0.,1.)", "(0.,0.,1E0)"), ("E-", "e-"), (".T.", ".T"), ("''", "'")]
)
def test_the_parser_sees_faults(texts, old, new):
    damaged = texts["ap214"].replace(old, new, 1)
    with pytest.raises(simple_spf.CollectedValidationErrors):
        simple_spf.parse(filecontent=damaged, with_tree=False)
