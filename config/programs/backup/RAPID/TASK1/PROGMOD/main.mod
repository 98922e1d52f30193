MODULE main
  CONST robtarget p10:=[[0,125,400],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    MoveL p10,v100,fine,spindle\WObj:=wPanel;
  ENDPROC
ENDMODULE
