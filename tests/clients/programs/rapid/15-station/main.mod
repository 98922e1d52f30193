MODULE StationMain
  LOCAL CONST robtarget pOwn:=[[0,205,390],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    MoveL pShared,v100,fine,tSpindle\WObj:=wPanel;
    MoveL pOwn,v100,fine,tSpindle\WObj:=wPanel;
    Corner;
  ENDPROC
ENDMODULE
