"""The floor: load a finished shape from its binary BREP, turn it into STEP, write it."""

import sys

from OCP.BinTools import BinTools
from OCP.Message import Message
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TopoDS import TopoDS_Shape

source, target = sys.argv[1:]
Message.DefaultMessenger_s().ChangePrinters().Clear()
shape = TopoDS_Shape()
BinTools.Read_s(shape, source)
writer = STEPControl_Writer()
writer.Transfer(shape, STEPControl_AsIs)
writer.Write(target)
