MODULE StationCorner
  PROC Corner()
    MoveL Offs(pShared,-15,0,0),v100,fine,tSpindle\WObj:=wPanel;
    MoveL Offs(Offs(pShared,-15,0,0),0,0,-7.5),v100,fine,tSpindle\WObj:=wPanel;
  ENDPROC
ENDMODULE
