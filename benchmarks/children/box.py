"""The box of the benchmarks as OpenCascade makes it, in its binary form."""

import sys
from pathlib import Path

from OCP.BinTools import BinTools
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.gp import gp_Pnt

sys.path.insert(0, str(Path(__file__).parents[1]))

from cases import BOX

BinTools.Write_s(
    BRepPrimAPI_MakeBox(gp_Pnt(*(-BOX / 2).tolist()), gp_Pnt(*(BOX / 2).tolist())).Shape(),
    sys.argv[1],
)
