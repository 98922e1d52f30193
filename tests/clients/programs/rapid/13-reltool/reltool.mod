MODULE ToolRelative
  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata wPanel:=[FALSE,TRUE,"",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];
  LOCAL CONST robtarget pT:=[[0,165,400],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    MoveL RelTool(pT,0,0,-25),v100,z1,tSpindle\WObj:=wPanel;
    MoveL RelTool(pT,0,0,-25\Rz:=15),v100,z1,tSpindle\WObj:=wPanel;
    MoveL RelTool(Offs(pT,-10,0,0),5,0,0\Rx:=2\Ry:=-1),v100,fine,tSpindle\WObj:=wPanel;
    MoveL pT,v100,fine,tSpindle\WObj:=wPanel;
  ENDPROC
ENDMODULE
